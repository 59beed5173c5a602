/* SPDX-License-Identifier: Apache-2.0 */
/* What protections report. */
#ifndef FLIGHT_MSG_PROTECTION_H
#define FLIGHT_MSG_PROTECTION_H

#include "flight/msg/head.h"

/** Where a protection stands. */
typedef struct ProtectionState {
    Head head;
    double value;     ///< [-] what is watched, as a part of its limit: above 1 it is beyond
    uint32_t tripped; ///< [-] in [0, 1]: 1: the limit was exceeded for long enough
    uint32_t count;   ///< [-] updates in a row beyond the limit
    uint32_t trips;   ///< [-] how often it has tripped since the reset
    uint32_t unknown; ///< [-] updates since the reset in which there was nothing to judge
} ProtectionState;

enum { UNITS_MAX = 32 };

/** What a unit of the spacecraft is used for. */
typedef enum UnitState {
    UNIT_ABSENT = 0,    ///< there is no such unit
    UNIT_OFF = 1,       ///< neither used nor ready
    UNIT_PRIMARY = 2,   ///< in use
    UNIT_REDUNDANT = 3, ///< ready to take over
    UNIT_FAULTED = 4    ///< isolated, until the ground clears its fault
} UnitState;

/** The units of the spacecraft. Bit i of a set is that of unit, kind, load or rule i. */
typedef struct UnitTable {
    Head head;
    int64_t fired_at;   ///< [ns] when a rule responded last; -1: none has
    uint32_t fired;     ///< [-] place + 1 of that rule; 0: none has
    uint32_t responses; ///< [-] of rules, since the reset
    uint32_t used;      ///< [-] units that are in use
    uint32_t faulted;   ///< [-] units that are isolated
    uint32_t reduced;   ///< [-] kinds with fewer units in use than at the start
    uint32_t lost;      ///< [-] kinds of which none is in use any more
    uint32_t loads;     ///< [-] loads of the power unit that units decide
    uint32_t powered;   ///< [-] those of them that shall be on
    uint32_t wrong;     ///< [-] rules whose last check was wrong
    uint32_t stopped;   ///< [-] rules that have responded as often as they may
    uint32_t bad;       ///< [-] rules that name no number of an output
    uint32_t kept;      ///< [-] in [0, 1]: 1: the non-volatile memory has the states
    uint32_t waits;     ///< [-] in [0, 1]: 1: its answer after a start is under way: loads stay as they are, and
                        ///< selectors take no unit
    uint32_t spare;
    UnitState state[UNITS_MAX]; ///< [-] of each unit
    uint8_t left[UNITS_MAX];    ///< [-] of each kind: units in use or ready
} UnitTable;

/** Whether the unit at a place is in use, as far as is known. */
static inline int unit_used(const UnitTable *table, uint32_t place)
{
    /* undecided: a guard of the array; the bounds of the places are within */
    return table->waits == 0u && place < UNITS_MAX && table->state[place] == UNIT_PRIMARY;
}

enum { UNIT_CHOICES = 4 };

/** Which of several units speaks for its kind. */
typedef struct UnitChoice {
    Head head;
    double age[UNIT_CHOICES]; ///< [s] how long ago each has measured; one that never has: since the start
    uint32_t taken;           ///< [-] place + 1, among them, of the one that is taken; 0: none is in use
    uint32_t changes;         ///< [-] how often another one was taken
} UnitChoice;

/** What a protection remembers. */
typedef struct Judgement {
    int64_t last;    ///< [ns] time of the data that were judged last
    uint32_t within; ///< [-] updates in a row within the limits
    uint32_t any;    ///< [-] 1 once there were data
} Judgement;

#endif

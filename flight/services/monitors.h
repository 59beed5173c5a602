/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_MONITORS_H
#define FLIGHT_SERVICES_MONITORS_H

#include "flight/command/command.h"
#include "flight/exec/event.h"
#include "flight/msg/event.h"
#include "flight/msg/services.h"

enum { MONITORS = 16 };

/** What a monitor checks. */
typedef enum MonitorKind {
    MONITOR_NOTHING = 0,
    MONITOR_LIMITS = 1,  ///< the number is in [low, high]
    MONITOR_DELTA = 2,   ///< its change from writing to writing is
    MONITOR_EXPECTED = 3 ///< it equals low
} MonitorKind;

/** A check of a number of an output. */
typedef struct Monitor {
    double low;       ///< [SI] of what is right
    double high;      ///< [SI] of what is right
    int64_t hold;     ///< [ns] >= 0: it is wrong for so long,
    uint32_t count;   ///< [-] and at so many successive instants, before the monitor fires
    MonitorKind kind; ///< [-] what is checked
    uint32_t on;      ///< [-] in [0, 1]: 1: it is
    uint32_t output;  ///< [-] place in the dictionary
    uint32_t offset;  ///< [-] bytes from the output's beginning
    uint32_t type;    ///< [-] in [0, 11]: FledgeType of the number
    uint32_t n;       ///< [-] numbers in a row that are measured
    uint32_t measure; ///< [-] in [0, 2]: ExecMeasure: the number, the norm, the largest magnitude
    uint32_t list;    ///< [-] in [0, 15]: the sequence of stored commands that it starts; 0: none
    uint32_t spare;
} Monitor;

/** What it says. */
typedef enum MonitorsEventId {
    MONITORS_FIRED = 1, ///< medium, monitor [-], value [SI]: its check stayed wrong; value: of the last one
    MONITORS_RIGHT = 2, ///< info, monitor [-], value [SI]: the check of one that had fired is right again
    MONITORS_BAD = 3    ///< low, monitor [-]: it names no number of an output
} MonitorsEventId;

/** What a monitor remembers. */
typedef struct MonitorMemory {
    ExecEvent event;
    double last;       ///< [SI] the number of the last writing
    uint32_t sequence; ///< [-] of it; 0: none yet
    uint32_t wrong;    ///< [-] 1: what it checked last
} MonitorMemory;

/** Checks of outputs' numbers, which each start a sequence of stored commands if what they check stays wrong.
 *
 *  At each instant, after the commands of the ground, each monitor that is on looks at its output as the last instant
 *  left it, in doubles: limits of a number, of its change, or a value; a number that is none is wrong. It fires by the
 *  rules of events (flight/exec/event.h): when the check has been wrong for `hold` and at `count` instants, once, and
 *  again after it was right. It then says so in `event` and starts its sequence, by a command that is checked and
 *  reported as any.
 *  An output that was never written is not checked.
 *
 *  Monitors are parameters: commands write, read back and turn them on or off. */
typedef struct Monitors {
    struct {
        MonitorState state;
        FlightEvent event;
    } out;
    struct {
        Monitor monitors[MONITORS];
    } par;
    struct {
        MonitorMemory watched[MONITORS];
        int64_t looked;   ///< [ns] at the last instant
        uint32_t begun;   ///< [-] 1: there was one
        uint32_t fired;   ///< [-] how often monitors fired
        uint32_t pending; ///< [-] bit i: the sequence of monitor i is to be started
        uint32_t bad;     ///< [-] bit i: monitor i names no number
    } mem;
} Monitors;

void monitors_reset(Monitors *m);
void monitors_update(Monitors *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService monitors_service;

#endif

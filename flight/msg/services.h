/* SPDX-License-Identifier: Apache-2.0 */
/* What flight services say of themselves. */
#ifndef FLIGHT_MSG_SERVICES_H
#define FLIGHT_MSG_SERVICES_H

#include "flight/msg/head.h"

/** The commands that wait on board. Bit i of a set is that of list i. */
typedef struct StoredState {
    Head head;
    int64_t next;       ///< [ns] of flight: when the next command is due, as things stand; -1: none is
    uint32_t running;   ///< [-] sequences that run
    uint32_t held;      ///< [-] lists that are held
    uint32_t inhibited; ///< [-] lists whose commands are not executed
    uint32_t stored;    ///< [-] commands in the store
    uint32_t released;  ///< [-] commands that were given to flight since the reset
    uint32_t skipped;   ///< [-] commands that were not: too late, inhibited or damaged
} StoredState;

/** The monitors of outputs. Bit i of a set is that of monitor i. */
typedef struct MonitorState {
    Head head;
    uint32_t on;    ///< [-] those that check
    uint32_t wrong; ///< [-] those whose last check was wrong
    uint32_t held;  ///< [-] those that have fired, and whose check was not right since
    uint32_t bad;   ///< [-] those that name no number of an output
    uint32_t fired; ///< [-] how often monitors fired since the reset
    uint32_t spare;
} MonitorState;

/** A monitor has fired, or the check of one that had is right again; the last one of an instant. */
typedef struct MonitorEvent {
    Head head;
    double value;     ///< [SI] the number
    uint32_t monitor; ///< [-] its place
    uint32_t wrong;   ///< [-] in [0, 1]: 1: it has fired
} MonitorEvent;

#endif

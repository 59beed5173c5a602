/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_MONITORS_H
#define FLIGHT_SERVICES_MONITORS_H

#include "flight/msg/event.h"
#include "flight/msg/services.h"
#include "flight/services/monitor.h"

enum { MONITORS = 16 };

/** Its events. */
typedef enum MonitorsEventId {
    MONITORS_FIRED = 1, ///< medium, monitor [-], value [SI]: its check stayed wrong; value: of the last one
    MONITORS_RIGHT = 2, ///< info, monitor [-], value [SI]: the check of one that had fired is right again
    MONITORS_BAD = 3    ///< low, monitor [-]: it names no number of an output
} MonitorsEventId;

/** Checks of outputs' numbers, which each start a sequence of stored commands if what they check stays wrong.
 *
 *  At each instant, after the commands of the ground, each monitor that is on looks at its output as the last instant
 *  left it, in doubles: limits of a number, of its change, a value, or bits; a number that is none is wrong. It fires
 *  by the rules of events (flight/exec/event.h): when the check has been wrong for `hold` and at `count` instants,
 *  once, and again after it was right. It then says so in `event` and starts its sequence, by a command that is checked
 *  and reported as any.
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
        int64_t evaluated; ///< [ns] at the last instant
        uint32_t begun;    ///< [-] 1: there was one
        uint32_t fired;    ///< [-] how often monitors fired
        uint32_t pending;  ///< [-] bit i: the sequence of monitor i is to be started
        uint32_t bad;      ///< [-] bit i: monitor i names no number
    } mem;
} Monitors;

void monitors_reset(Monitors *m);
void monitors_update(Monitors *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService monitors_service;

#endif

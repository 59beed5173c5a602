/* SPDX-License-Identifier: Apache-2.0 */
/* The board's clock: simulated time comes to flight as a tick, and flight answers when it is done.
 * The outside owns time. Between two ticks flight does not touch the registers: in a tick it reads what
 * the outside wrote before, and the outside reads what flight wrote when the tick is done. */
#ifndef REGISTERS_CLOCK_H
#define REGISTERS_CLOCK_H

#include "flight/msg/head.h"
#include "registers/lane.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The clock block: addresses in bytes from its start, and the side that stores there. */
enum {
    REGISTER_CLOCK_TICK = 0,  ///< outside: counts the ticks, stored last
    REGISTER_CLOCK_DONE = 4,  ///< flight: the tick it has finished
    REGISTER_CLOCK_TIME = 8,  ///< outside: t [ns], upper word first
    REGISTER_CLOCK_STEP = 16, ///< outside: dt [ns], upper word first
    REGISTER_CLOCK_STOP = 24, ///< outside: 1: there will be no more ticks
    REGISTER_CLOCK_SIZE = 32
};

/** Outside: start a tick. The one before must be done. */
void register_clock_start(const RegisterWindow *w, Tick tick);

/** Outside: whether flight has finished the last tick. */
int register_clock_is_done(const RegisterWindow *w);

/** Outside: there will be no more ticks. */
void register_clock_stop(const RegisterWindow *w);

/** Flight: whether a tick is due, and which one. */
int register_clock_due(const RegisterWindow *w, Tick *tick);

/** Flight: answer that the tick is done. */
void register_clock_finish(const RegisterWindow *w);

/** Flight: whether the outside has ended the run. */
int register_clock_stopped(const RegisterWindow *w);

#ifdef __cplusplus
}
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The outside's end of a slave clock (clock.h). All is integer arithmetic. */
#ifndef REGISTERS_SLAVE_CLOCK_H
#define REGISTERS_SLAVE_CLOCK_H

#include "flight/exec/drift.h"
#include "registers/clock.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Its state; register_slave_start sets all but the window. */
typedef struct RegisterSlaveClock {
    const RegisterWindow *window; ///< of a board with a slave clock
    ExecClock clock;              ///< of simulated time
    int64_t aligned;              ///< [ns] its time at the next pulse, if it is aligning
    int64_t shown;                ///< [ns] simulated time shown last; -1: none
    int aligning;
} RegisterSlaveClock;

/** As at simulated time 0, without pulses and commands. */
void register_slave_start(RegisterSlaveClock *c);

/** Show the time, and the pulses until then, at simulated time t >= 0 [ns], which never goes back. */
void register_slave_show(RegisterSlaveClock *c, int64_t t);

/** Obey the command of flight, if there is one, at simulated time t >= 0 [ns]. */
void register_slave_obey(RegisterSlaveClock *c, int64_t t);

#ifdef __cplusplus
}
#endif

#endif

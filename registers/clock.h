/* SPDX-License-Identifier: Apache-2.0 */
/* Two clocks.
 *
 * The clock of the board that paces flight: simulated time comes to flight as a tick, and flight answers when it is
 * done. The outside owns time. Between two ticks flight does not touch the registers: in a tick it reads what the
 * outside wrote before, and the outside reads what flight wrote when the tick is done.
 *
 * The outside resets flight's computer by a count. While the computer is down, no tick starts. At the first tick after
 * that the count is another one: a computer that sees this starts anew, as after power-on, before it answers the tick.
 * A program that starts within a run, after such a reset or by its watchdog, finds a tick with t >= 0 as its first one,
 * and begins flight at that t.
 *
 * A slave clock shows a time of its own, which drifts (flight/exec/drift.h), and which flight may jam, slew, or align
 * with the pulses of simulated time. It obeys a command when the tick of the command is done, as at its time. A tick
 * with t < 0 starts it anew. */
#ifndef REGISTERS_CLOCK_H
#define REGISTERS_CLOCK_H

#include "flight/msg/head.h"
#include "registers/lane.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The clock block: addresses in bytes from its start, and the side that stores there. */
enum {
    REGISTER_CLOCK_TICK = 0,   ///< outside: counts the ticks, stored last
    REGISTER_CLOCK_DONE = 4,   ///< flight: the tick it has finished
    REGISTER_CLOCK_TIME = 8,   ///< outside: t [ns], upper word first
    REGISTER_CLOCK_STEP = 16,  ///< outside: dt [ns], upper word first
    REGISTER_CLOCK_STOP = 24,  ///< outside: 1: there will be no more ticks
    REGISTER_CLOCK_RESET = 28, ///< outside: counts the resets of the computer, stored before the tick that follows
    REGISTER_CLOCK_SIZE = 32
};

/** The block of the slave clock. */
enum {
    REGISTER_SLAVE_TIME = 0,     ///< outside: its time [ns], upper word first
    REGISTER_SLAVE_TONE = 8,     ///< outside: its time at the last pulse [ns], upper word first
    REGISTER_SLAVE_PULSES = 16,  ///< outside: counts the pulses; the first is at simulated time 0
    REGISTER_SLAVE_STATUS = 20,  ///< outside: REGISTER_SLEWING ...
    REGISTER_SLAVE_DONE = 24,    ///< outside: the command that it obeyed last
    REGISTER_SLAVE_COMMAND = 28, ///< flight: counts the commands, stored last
    REGISTER_SLAVE_CODE = 32,    ///< flight: RegisterSlaveCode
    REGISTER_SLAVE_VALUE = 40,   ///< flight: [ns], upper word first
    REGISTER_SLAVE_SIZE = 48
};

typedef enum RegisterSlaveCode {
    REGISTER_JAM = 1,  ///< the clock shows the value at once
    REGISTER_SLEW = 2, ///< the clock gains the value, or loses it if it is negative, at its slew rate
    REGISTER_ALIGN = 3 ///< the clock shows the value at the next pulse
} RegisterSlaveCode;

enum {
    REGISTER_SLEWING = 1 << 0,  ///< a part of the offset is left
    REGISTER_ALIGNING = 1 << 1, ///< it waits for the pulse
    REGISTER_REFUSED = 1 << 2   ///< the last command had an unknown code
};

/** Flight: the time of the slave clock [ns]. */
int64_t register_slave_time(const RegisterWindow *w);

/** Flight: how many pulses there were; *tone, unless NULL: the time of the slave clock at the last one [ns]. */
uint32_t register_slave_pulses(const RegisterWindow *w, int64_t *tone);

/** Flight: REGISTER_SLEWING | REGISTER_ALIGNING | REGISTER_REFUSED. */
uint32_t register_slave_status(const RegisterWindow *w);

/** Flight: a command to the slave clock. REGISTER_FULL: it has not obeyed the last one yet. */
RegisterStatus register_slave_command(const RegisterWindow *w, RegisterSlaveCode code, int64_t value);

/** Outside: start a tick. The one before must be done. */
void register_clock_start(const RegisterWindow *w, Tick tick);

/** Outside: whether flight has finished the last tick. */
int register_clock_is_done(const RegisterWindow *w);

/** Outside: there will be no more ticks. */
void register_clock_stop(const RegisterWindow *w);

/** Outside: reset the computer, before the next tick. */
void register_clock_reset(const RegisterWindow *w);

/** Flight: how often the outside has reset the computer. */
uint32_t register_clock_resets(const RegisterWindow *w);

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

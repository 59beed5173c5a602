/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/clock.h"

/* A line that no interrupt has: it rings, and counts nothing. */
#define NO_LINE UINT32_MAX

static void store_long(const RegisterWindow *w, uint32_t address, int64_t value)
{
    const uint64_t bits = (uint64_t)value;
    register_store(w, address, (uint32_t)(bits >> 32));
    register_store(w, address + 4u, (uint32_t)bits);
}

static int64_t load_long(const RegisterWindow *w, uint32_t address)
{
    const uint64_t high = register_load(w, address);
    return (int64_t)(high << 32 | register_load(w, address + 4u));
}

static void ring(const RegisterWindow *w)
{
    if (w->ring) {
        w->ring(w->user, NO_LINE);
    }
}

void register_clock_start(const RegisterWindow *w, Tick tick)
{
    const uint32_t clock = w->board->clock;
    store_long(w, clock + REGISTER_CLOCK_TIME, tick.t);
    store_long(w, clock + REGISTER_CLOCK_STEP, tick.dt);
    register_store(w, clock + REGISTER_CLOCK_TICK, register_load(w, clock + REGISTER_CLOCK_TICK) + 1u);
    if (w->board->clock_interrupt >= 0) {
        register_raise(w, (uint32_t)w->board->clock_interrupt);
    } else {
        ring(w);
    }
}

int register_clock_is_done(const RegisterWindow *w)
{
    return register_load(w, w->board->clock + REGISTER_CLOCK_DONE) ==
           register_load(w, w->board->clock + REGISTER_CLOCK_TICK);
}

void register_clock_stop(const RegisterWindow *w)
{
    register_store(w, w->board->clock + REGISTER_CLOCK_STOP, 1u);
    ring(w);
}

void register_clock_reset(const RegisterWindow *w)
{
    register_store(w, w->board->clock + REGISTER_CLOCK_RESET, register_clock_resets(w) + 1u);
}

uint32_t register_clock_resets(const RegisterWindow *w)
{
    return register_load(w, w->board->clock + REGISTER_CLOCK_RESET);
}

int register_clock_due(const RegisterWindow *w, Tick *tick)
{
    if (register_clock_is_done(w)) {
        return 0;
    }
    tick->t = load_long(w, w->board->clock + REGISTER_CLOCK_TIME);
    tick->dt = load_long(w, w->board->clock + REGISTER_CLOCK_STEP);
    return 1;
}

void register_clock_finish(const RegisterWindow *w)
{
    register_store(w, w->board->clock + REGISTER_CLOCK_DONE, register_load(w, w->board->clock + REGISTER_CLOCK_TICK));
    ring(w);
}

int register_clock_stopped(const RegisterWindow *w)
{
    return register_load(w, w->board->clock + REGISTER_CLOCK_STOP) != 0u;
}

int64_t register_slave_time(const RegisterWindow *w)
{
    return load_long(w, w->board->slave->address + REGISTER_SLAVE_TIME);
}

uint32_t register_slave_pulses(const RegisterWindow *w, int64_t *tone)
{
    if (tone) {
        *tone = load_long(w, w->board->slave->address + REGISTER_SLAVE_TONE);
    }
    return register_load(w, w->board->slave->address + REGISTER_SLAVE_PULSES);
}

uint32_t register_slave_status(const RegisterWindow *w)
{
    return register_load(w, w->board->slave->address + REGISTER_SLAVE_STATUS);
}

RegisterStatus register_slave_command(const RegisterWindow *w, RegisterSlaveCode code, int64_t value)
{
    const uint32_t slave = w->board->slave->address;
    const uint32_t given = register_load(w, slave + REGISTER_SLAVE_COMMAND);
    if (given != register_load(w, slave + REGISTER_SLAVE_DONE)) {
        return REGISTER_FULL;
    }
    store_long(w, slave + REGISTER_SLAVE_VALUE, value);
    register_store(w, slave + REGISTER_SLAVE_CODE, (uint32_t)code);
    register_store(w, slave + REGISTER_SLAVE_COMMAND, given + 1u);
    return REGISTER_OK;
}

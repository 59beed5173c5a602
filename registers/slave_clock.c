/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/slave_clock.h"

#define SECOND INT64_C(1000000000)

/* The largest integer up to s * rate, of a time s >= 0 [ns] and a rate [ns/s]. */
static int64_t scaled(int64_t s, int64_t rate)
{
    const int64_t part = s % SECOND * rate; /* at most 1e9 times 1e9 */
    return s / SECOND * rate + part / SECOND - (part % SECOND < 0);
}

/* a + b of any two times; beyond the range it wraps, as a counter does. */
static int64_t sum(int64_t a, int64_t b)
{
    return (int64_t)((uint64_t)a + (uint64_t)b);
}

static const RegisterSlave *slave_of(const RegisterSlaveClock *c)
{
    return c->window->board->slave;
}

static void store_long(const RegisterSlaveClock *c, uint32_t place, int64_t value)
{
    const uint32_t address = slave_of(c)->address + place;
    register_store(c->window, address, (uint32_t)((uint64_t)value >> 32));
    register_store(c->window, address + 4u, (uint32_t)value);
}

/* The part of the offset that is done at simulated time t. */
static int64_t gained(const RegisterSlaveClock *c, int64_t t)
{
    const int64_t most = scaled(t - c->since, slave_of(c)->slew);
    return c->offset > most ? most : c->offset < -most ? -most : c->offset;
}

static int64_t time_at(const RegisterSlaveClock *c, int64_t t)
{
    const int64_t s = t - c->since;
    return sum(sum(c->base, s + scaled(s, slave_of(c)->drift)), gained(c, t));
}

static void store_status(const RegisterSlaveClock *c, int64_t t, uint32_t refused)
{
    const uint32_t status =
        (gained(c, t) != c->offset ? REGISTER_SLEWING : 0u) | (c->aligning ? REGISTER_ALIGNING : 0u) | refused;
    register_store(c->window, slave_of(c)->address + REGISTER_SLAVE_STATUS, status);
}

void register_slave_start(RegisterSlaveClock *c)
{
    const uint32_t address = slave_of(c)->address;
    c->since = c->offset = c->aligned = 0;
    c->base = slave_of(c)->start;
    c->shown = -1;
    c->aligning = 0;
    store_long(c, REGISTER_SLAVE_TIME, c->base);
    store_long(c, REGISTER_SLAVE_TONE, c->base);
    register_store(c->window, address + REGISTER_SLAVE_PULSES, 0u);
    register_store(c->window, address + REGISTER_SLAVE_DONE,
                   register_load(c->window, address + REGISTER_SLAVE_COMMAND));
    store_status(c, 0, 0u);
}

void register_slave_show(RegisterSlaveClock *c, int64_t t)
{
    /* The pulses at the multiples of `pulse` after the time shown last. */
    const int64_t pulse = slave_of(c)->pulse;
    const int64_t first = c->shown < 0 ? 0 : c->shown / pulse + 1, last = t / pulse;
    if (first <= last) {
        if (c->aligning) {
            c->since = first * pulse;
            c->base = c->aligned;
            c->offset = 0;
            c->aligning = 0;
        }
        store_long(c, REGISTER_SLAVE_TONE, time_at(c, last * pulse));
        register_store(c->window, slave_of(c)->address + REGISTER_SLAVE_PULSES, (uint32_t)(last + 1));
        for (int64_t k = first; k <= last && slave_of(c)->interrupt >= 0; k++) {
            register_raise(c->window, (uint32_t)slave_of(c)->interrupt);
        }
    }
    c->shown = t;
    store_long(c, REGISTER_SLAVE_TIME, time_at(c, t));
    store_status(c, t, register_slave_status(c->window) & REGISTER_REFUSED);
}

void register_slave_obey(RegisterSlaveClock *c, int64_t t)
{
    const uint32_t address = slave_of(c)->address;
    const uint32_t given = register_load(c->window, address + REGISTER_SLAVE_COMMAND);
    if (given == register_load(c->window, address + REGISTER_SLAVE_DONE)) {
        return;
    }
    const uint64_t high = register_load(c->window, address + REGISTER_SLAVE_VALUE);
    const int64_t value = (int64_t)(high << 32 | register_load(c->window, address + REGISTER_SLAVE_VALUE + 4u));
    const uint32_t code = register_load(c->window, address + REGISTER_SLAVE_CODE);
    if (code == REGISTER_JAM || code == REGISTER_SLEW) {
        c->base = code == REGISTER_JAM ? value : time_at(c, t);
        c->offset = code == REGISTER_JAM ? 0 : value;
        c->since = t;
        c->aligning = 0;
    } else if (code == REGISTER_ALIGN) {
        c->aligned = value;
        c->aligning = 1;
    }
    store_status(c, t, code < REGISTER_JAM || code > REGISTER_ALIGN ? REGISTER_REFUSED : 0u);
    register_store(c->window, address + REGISTER_SLAVE_DONE, given);
}

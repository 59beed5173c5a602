/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/slave_clock.h"

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

static void store_status(const RegisterSlaveClock *c, int64_t t, uint32_t refused)
{
    const uint32_t status = (exec_clock_gained(&c->clock, t) != c->clock.offset ? REGISTER_SLEWING : 0u) |
                            (c->aligning ? REGISTER_ALIGNING : 0u) | refused;
    register_store(c->window, slave_of(c)->address + REGISTER_SLAVE_STATUS, status);
}

void register_slave_start(RegisterSlaveClock *c)
{
    const uint32_t address = slave_of(c)->address;
    c->clock = (ExecClock){0, slave_of(c)->start, 0, slave_of(c)->drift, slave_of(c)->slew};
    c->aligned = 0;
    c->shown = -1;
    c->aligning = 0;
    store_long(c, REGISTER_SLAVE_TIME, c->clock.base);
    store_long(c, REGISTER_SLAVE_TONE, c->clock.base);
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
            exec_clock_set(&c->clock, first * pulse, c->aligned, 0);
            c->aligning = 0;
        }
        store_long(c, REGISTER_SLAVE_TONE, exec_clock_time(&c->clock, last * pulse));
        register_store(c->window, slave_of(c)->address + REGISTER_SLAVE_PULSES, (uint32_t)(last + 1));
        for (int64_t k = first; k <= last && slave_of(c)->interrupt >= 0; k++) {
            register_raise(c->window, (uint32_t)slave_of(c)->interrupt);
        }
    }
    c->shown = t;
    store_long(c, REGISTER_SLAVE_TIME, exec_clock_time(&c->clock, t));
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
        const int jams = code == REGISTER_JAM;
        exec_clock_set(&c->clock, t, jams ? value : exec_clock_time(&c->clock, t), jams ? 0 : value);
        c->aligning = 0;
    } else if (code == REGISTER_ALIGN) {
        c->aligned = value;
        c->aligning = 1;
    }
    store_status(c, t, code < REGISTER_JAM || code > REGISTER_ALIGN ? REGISTER_REFUSED : 0u);
    register_store(c->window, address + REGISTER_SLAVE_DONE, given);
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/vehicle/power_manager.h"

#include <string.h>

void power_manager_reset(PowerManager *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
    for (uint32_t i = 0u; i < LOADS_MAX; i++) {
        m->mem.tripped_at[i] = -1;
    }
}

/* The trips whose time is over, a bit for each. */
static uint32_t to_clear(PowerManager *m, int64_t t)
{
    uint32_t clear = 0u;
    for (uint32_t i = 0u; i < LOADS_MAX; i++) {
        int64_t *at = &m->mem.tripped_at[i];
        if ((m->in.power.tripped >> i & 1u) == 0u) {
            *at = -1;
        } else if (*at < 0) {
            *at = t;
        }
        if (*at >= 0 && tick_since(t, *at) >= m->par.clear_after && m->mem.cleared[i] < m->par.clears) {
            clear |= 1u << i;
        }
    }
    return clear;
}

void power_manager_update(PowerManager *m, Tick t)
{
    const PowerTelemetry *power = &m->in.power;
    PowerCommand *command = &m->out.command;
    if (!head_written(power->head)) {
        command->head = head_held(command->head);
        return;
    }
    const uint32_t clear = to_clear(m, t.t);
    const uint32_t on = m->par.on & ~(power->tripped & ~clear);
    const int obeyed = command->number == 0u || command->number == power->number;
    if (obeyed && (on != power->on || clear != 0u || m->par.reset_computer != 0u)) {
        command->number = power->number + 1u;
        command->number += command->number == 0u;
        command->on = on;
        command->clear = clear;
        command->reset = m->par.reset_computer;
        for (uint32_t i = 0u; i < LOADS_MAX; i++) {
            m->mem.cleared[i] += clear >> i & 1u;
        }
    }
    command->heartbeat += m->par.silent == 0u;
    command->head = head_next(command->head, t.t, quality_through(power->head));
}

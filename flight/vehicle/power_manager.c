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
static uint32_t to_clear(PowerManager *m, uint32_t tripped, int64_t t)
{
    uint32_t clear = 0u;
    for (uint32_t i = 0u; i < LOADS_MAX; i++) {
        int64_t *at = &m->mem.tripped_at[i];
        if ((tripped >> i & 1u) == 0u) {
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

/* The cards whose counters stand still, a bit for each. */
static uint32_t silent_cards(PowerManager *m, int64_t t)
{
    const PowerTelemetry *power = &m->in.power;
    const int first = !head_written(m->out.state.head);
    uint32_t silent = 0u;
    for (uint32_t c = 0u; c <= SWITCH_CARDS; c++) {
        const uint32_t counter = c < SWITCH_CARDS ? power->cards[c].counter : power->counter;
        if (first || counter != m->mem.counters[c]) {
            m->mem.counters[c] = counter;
            m->mem.counted[c] = t;
        }
        const int stands = m->par.silent_after > 0 && tick_since(t, m->mem.counted[c]) >= m->par.silent_after;
        silent |= stands ? 1u << c : 0u;
    }
    return silent;
}

void power_manager_update(PowerManager *m, Tick t)
{
    const PowerTelemetry *power = &m->in.power;
    PowerCommand *command = &m->out.command;
    if (!head_written(power->head)) {
        command->head = head_held(command->head);
        m->out.state.head = head_held(m->out.state.head);
        return;
    }
    PowerState *state = &m->out.state;
    state->silent = silent_cards(m, t.t);
    uint32_t reports = 0u; /* the loads of cards that report */
    for (uint32_t c = 0u; c < SWITCH_CARDS; c++) {
        reports |= (state->silent >> c & 1u) ? 0u : 0xFFu << CARD_LOADS * c;
    }
    state->on = power_on(power) & reports;
    state->tripped = power_tripped(power);
    state->battery = power->battery;
    const uint32_t clear = to_clear(m, state->tripped & reports, t.t);
    const UnitTable *units = &m->in.units; /* all zero: it decides no load */
    const uint32_t decided = units->loads & (units->waits != 0u ? power_on(power) : units->powered);
    const uint32_t on = ((m->par.on & ~units->loads) | decided) & ~(state->tripped & ~clear);
    const int obeyed = command->number == 0u || command->number == power->number;
    if (obeyed && ((on & reports) != state->on || clear != 0u || m->par.reset_computer != 0u)) {
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
    state->head = head_next(state->head, t.t, quality_through(power->head));
}

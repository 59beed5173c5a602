/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/formation_roll.h"

#include <string.h>

void formation_roll_reset(FormationRoll *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void formation_roll_update(FormationRoll *m, Tick t)
{
    const BodyState *const in[ROLL_MEMBERS] = {&m->in.a, &m->in.b, &m->in.c, &m->in.d,
                                               &m->in.e, &m->in.f, &m->in.g, &m->in.h};
    FormationState *state = &m->out.state;
    uint32_t present = 0u;
    for (uint32_t i = 0u; i < ROLL_MEMBERS; i++) {
        if (in[i]->head.quality >= QUALITY_DEGRADED) {
            present |= 1u << i;
            m->mem.last[i] = in[i]->head.t;
        }
        const int known = ((m->mem.known | present) >> i & 1u) != 0u;
        state->age[i] = known ? tick_seconds(tick_since(t.t, m->mem.last[i])) : 0.0;
    }
    const uint32_t gone = state->heard & ~present, come = present & ~state->heard;
    m->mem.known |= present;
    state->heard = present;
    state->lost = m->mem.known & ~present;
    state->head = head_next(state->head, t.t, QUALITY_GOOD);
    if (come != 0u) {
        event_publish(&m->out.event, t.t,
                      (FlightEvent){.id = FORMATION_ROLL_HEARD, .severity = EVENT_INFO, .arguments = {come}});
    }
    if (gone != 0u) {
        event_publish(&m->out.event, t.t,
                      (FlightEvent){.id = FORMATION_ROLL_LOST, .severity = EVENT_MEDIUM, .arguments = {gone}});
    }
}

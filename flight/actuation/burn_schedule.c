/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/burn_schedule.h"

#include <string.h>

void burn_schedule_reset(BurnSchedule *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void burn_schedule_update(BurnSchedule *m, Tick t)
{
    const PropulsionState *card = &m->in.card;
    BurnCommand *burn = &m->out.burn;
    uint32_t *next = &m->mem.next;
    if (!head_written(card->head)) {
        burn->head = head_held(burn->head);
        return;
    }
    while (t.dt == 0 && *next < m->par.n && m->par.start[*next] < t.t) {
        ++*next; /* before this start of flight */
    }
    const int taken = burn->number == 0u || burn->number == card->number;
    if (taken && m->par.armed != 0u && card->armed != 0u && *next < m->par.n && *next < BURNS_MAX &&
        tick_since(m->par.start[*next], t.t) <= m->par.ahead) {
        burn->number = card->number + 1u;
        burn->number += burn->number == 0u;
        burn->thruster = m->par.thruster[*next];
        burn->start = m->par.start[*next];
        burn->duration = m->par.duration[*next];
        ++*next;
    }
    burn->armed = m->par.armed;
    burn->head = head_next(burn->head, t.t, quality_through(card->head));
}

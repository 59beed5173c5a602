/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/burn_schedule.h"

#include <string.h>

void burn_schedule_reset(BurnSchedule *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static int64_t nanoseconds(double s)
{
    return (int64_t)(s * 1e9 + 0.5);
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
    while (m->mem.begun == 0u && *next < m->par.n && nanoseconds(m->par.start[*next]) < t.t) {
        ++*next; /* before this start of flight */
    }
    m->mem.begun = 1u;
    const int taken = burn->number == 0u || burn->number == card->number;
    if (taken && m->par.armed != 0u && card->armed != 0u && *next < m->par.n && *next < BURNS_MAX &&
        tick_since(nanoseconds(m->par.start[*next]), t.t) <= m->par.ahead) {
        burn->number = card->number + 1u;
        burn->number += burn->number == 0u;
        burn->thruster = m->par.thruster[*next];
        burn->start = nanoseconds(m->par.start[*next]);
        burn->duration = nanoseconds(m->par.duration[*next]);
        ++*next;
    }
    burn->armed = m->par.armed;
    burn->head = head_next(burn->head, t.t, quality_through(card->head));
}

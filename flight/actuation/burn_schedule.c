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
    ThrusterTimes *times = &m->out.times;
    if (!head_written(times->head)) {
        m->mem.begun = t.t;
    }
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t k = 0u; k < m->par.n && k < BURNS_MAX; k++) {
        const uint32_t i = m->par.thruster[k] % THRUSTERS_MAX;
        const int64_t start = nanoseconds(m->par.start[k]);
        const int is_next = times->off[i] <= t.t && start >= times->off[i] && start >= m->mem.begun;
        if (is_next && tick_since(start, t.t) <= m->par.ahead && start + nanoseconds(m->par.duration[k]) > t.t) {
            times->on[i] = start;
            times->off[i] = start + nanoseconds(m->par.duration[k]);
            times->burns[i]++;
        }
    }
    times->head = head_next(times->head, t.t, QUALITY_GOOD);
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/time_correlation.h"

#include <math.h>
#include <string.h>

void time_correlation_reset(TimeCorrelation *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* a + b, or the nearest that an int64_t holds. */
static int64_t later(int64_t a, int64_t b)
{
    return tick_since(a, b == INT64_MIN ? INT64_MAX : -b);
}

void time_correlation_update(TimeCorrelation *m, Tick t)
{
    const Head clock = m->in.vehicle.head;
    const int64_t since = tick_since(head_written(clock) ? m->in.vehicle.time : t.t, m->par.clock_0);
    const double gained = m->par.drift * (double)since;
    m->out.time.time = later(later(m->par.time_0, since), (int64_t)(gained + (gained < 0.0 ? -0.5 : 0.5)));
    m->out.time.head = head_next(m->out.time.head, t.t, quality_optional(clock));
}

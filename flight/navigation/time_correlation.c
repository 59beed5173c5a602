/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/time_correlation.h"

#include "flight/navigation/correlation.h"

#include <string.h>

void time_correlation_reset(TimeCorrelation *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void time_correlation_update(TimeCorrelation *m, Tick t)
{
    m->out.time.time = correlated_time(m->in.vehicle, t.t, m->par.clock_0, m->par.time_0, m->par.drift);
    m->out.time.head = head_next(m->out.time.head, t.t, quality_optional(m->in.vehicle.head));
}

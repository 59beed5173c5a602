/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/utc_correlation.h"

#include "flight/navigation/correlation.h"

#include <string.h>

void utc_correlation_reset(UtcCorrelation *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void utc_correlation_update(UtcCorrelation *m, Tick t)
{
    m->out.time.time = correlated_time(m->in.vehicle, t.t, m->par.clock_0, m->par.time_0, m->par.drift);
    m->out.time.head = head_next(m->out.time.head, t.t, quality_optional(m->in.vehicle.head));
}

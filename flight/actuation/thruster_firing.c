/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/thruster_firing.h"

#include <string.h>

#include "flight/math/vec.h"

void thruster_firing_reset(ThrusterFiring *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* [s] How long thruster i shall be open, of the time that its force asks for. */
static double open_for(const ThrusterFiring *m, uint32_t i, double wanted)
{
    const double least = m->par.min_on;
    if (wanted >= least) {
        return wanted < m->par.period ? wanted : m->par.period;
    }
    const int opened = (m->mem.opened >> i & 1u) && wanted > m->par.level_off * least;
    return wanted > 0.0 && (wanted >= m->par.level_on * least || opened) ? least : 0.0;
}

void thruster_firing_update(ThrusterFiring *m, Tick t)
{
    const ThrusterSet *set = &m->in.thrusters;
    ThrusterTimes *times = &m->out.times;
    const Quality quality = quality_min(quality_through(m->in.forces.head), quality_through(set->head));
    const int fresh = quality_min(m->in.forces.head.quality, set->head.quality) > QUALITY_STALE &&
                      !data_lost(t, m->in.forces.head.t, m->par.period);

    double on[THRUSTERS_MAX] = {0.0};
    int fires = fresh;
    for (uint32_t i = 0; i < thrusters_count(set); i++) {
        const double wanted = m->par.period * m->in.forces.F[i] / set->F_max[i];
        fires = fires && isfinite(wanted);
        on[i] = open_for(m, i, wanted);
    }
    if (!head_written(times->head) && !fresh) {
        return;
    }
    m->mem.opened = 0u;
    for (uint32_t i = 0; i < THRUSTERS_MAX; i++) {
        if (fires && on[i] > 0.0) {
            const int goes_on = times->burns[i] > 0u && times->off[i] >= t.t && times->on[i] <= t.t;
            times->on[i] = goes_on ? times->on[i] : t.t;
            /* open: NaN is not above 0, so it is not converted, which the analyser does not see */
            times->off[i] = tick_since(t.t, -(int64_t)(on[i] * 1e9 + 0.5));
            times->burns[i] += !goes_on;
            m->mem.opened |= 1u << i;
        } else if (times->off[i] > t.t) {
            times->off[i] = t.t;
        }
    }
    times->head = head_next(times->head, t.t, fires ? quality : QUALITY_DEGRADED);
}

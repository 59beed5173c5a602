/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/sun_direction.h"

#include <string.h>

#include "flight/math/elementary.h"
#include "flight/sensing/sun_fit.h"

void sun_direction_reset(SunDirection *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* What the sensors say. 0: one of them says nothing that is finite. */
static int view(const SunDirection *m, int counted, uint32_t n, SunView *v)
{
    memset(v, 0, sizeof *v);
    for (uint32_t i = 0u; i < n; i++) {
        const double current =
            counted ? m->par.offset + m->par.scale * m->in.counts.counts[i] : m->in.currents.current[i];
        v->axis[i] = vec_unit(m->par.axes_B[i]);
        v->weight[i] = m->par.weight[i] > 0.0 ? m->par.weight[i] : 1.0;
        v->edge[i] = m->par.view[i] > 0.0 ? fm_cos(m->par.view[i]) : 0.0;
        v->cosine[i] = current / m->par.current[i];
        v->lit |= v->cosine[i] >= m->par.dark ? 1u << i : 0u;
        if (!isfinite(v->cosine[i])) {
            return 0;
        }
    }
    return 1;
}

void sun_direction_update(SunDirection *m, Tick t)
{
    const int counted = m->par.scale > 0.0;
    const Head head = counted ? m->in.counts.head : m->in.currents.head;
    const uint32_t n = m->par.n < SUN_SENSORS_MAX ? m->par.n : SUN_SENSORS_MAX;
    SunView v;
    if (!view(m, counted, n, &v) || !head_written(head)) {
        m->out.heading.head = head_held(m->out.heading.head);
        m->out.cosines.head = head_held(m->out.cosines.head);
        return;
    }
    const Quality quality = quality_through(head);
    m->out.cosines = sun_cosines(&v, n, v.lit, head_next(m->out.cosines.head, t.t, quality));
    const SunFit f = sun_fit(&v, (1u << n) - 1u);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (f.rank > 0 && f.misfit <= m->par.differ && vec_finite(f.s_B)) {
        const Quality whole = f.rank == 3 ? QUALITY_GOOD : QUALITY_DEGRADED;
        m->out.heading = (SunHeading){head_next(m->out.heading.head, t.t, quality_min(quality, whole)), f.s_B};
    } else {
        m->out.heading.head = head_held(m->out.heading.head);
    }
}

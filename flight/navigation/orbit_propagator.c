/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/orbit_propagator.h"

#include <string.h>

void orbit_propagator_reset(OrbitPropagator *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void orbit_propagator_update(OrbitPropagator *m, Tick t)
{
    const NavOrbit *fix = &m->in.fix;
    Quality placed;
    const Vec3 pole = orbit_pole(&m->in.planet, &placed);
    const OrbitField field = {m->par.mu, m->par.radius, m->par.J2, m->par.J3, m->par.J4, pole};
    const int64_t step = orbit_step_ns(m->par.step);

    OrbitPoint at = m->mem.at;
    int64_t now = m->mem.t, fixed = m->mem.fixed;
    uint32_t sequence = m->mem.sequence;
    Quality quality = t.t < now ? QUALITY_NONE : m->mem.quality;
    const OrbitPoint measured = {fix->r_BN_N, fix->v_BN_N};
    const int other = fix->head.t != fixed || fix->head.sequence != sequence || quality == QUALITY_NONE;
    if (fix->head.quality >= QUALITY_DEGRADED && fix->head.t <= t.t && other && orbit_sound(&field, measured)) {
        at = measured;
        now = fixed = fix->head.t;
        sequence = fix->head.sequence;
        quality = fix->head.quality;
    }
    at = orbit_go(&field, at, &now, t.t, step, m->par.steps);
    const Vec3 a = orbit_gravity(&field, at.r);

    NavOrbit *orbit = &m->out.orbit;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (quality != QUALITY_NONE && step > 0 && vec_finite(at.r) && vec_finite(at.v) && vec_finite(a)) {
        const int fresh = now == t.t && tick_seconds(tick_since(t.t, fixed)) <= m->par.age_max;
        const Quality worst = quality_min(quality, fresh ? placed : QUALITY_DEGRADED);
        *orbit = (NavOrbit){head_next(orbit->head, now, worst), at.r, at.v, a};
        m->mem.at = at;
        m->mem.t = now;
        m->mem.fixed = fixed;
        m->mem.sequence = sequence;
        m->mem.quality = quality;
    } else {
        orbit->head = head_held(orbit->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/sun_safe.h"

#include <string.h>

void sun_safe_reset(SunSafe *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* sigma_BR, for which [BR] c = s. */
static Vec3 turn_to(Vec3 s, Vec3 c)
{
    const Vec3 across = vec_cross(s, c);
    const double sine = vec_norm(across);
    const double angle = fm_atan2(sine, vec_dot(s, c));
    const Vec3 e = sine > 1e-12 ? vec_scale(1.0 / sine, across) : vec_unit(vec_cross(c, vec_far_axis(c)));
    return vec_scale(fm_tan(0.25 * angle), e);
}

void sun_safe_update(SunSafe *m, Tick t)
{
    const Vec3 omega_BN = m->in.rate.omega_BN_B;
    const Vec3 s = vec_unit(m->in.sun.s_B);
    AttError *out = &m->out.error;
    AttError error;
    Quality quality = quality_through(m->in.rate.head);
    const Quality of_sun = quality_through(m->in.sun.head);
    const int seen = of_sun != QUALITY_NONE && vec_finite(s) && vec_norm2(s) > 0.0 &&
                     !data_lost(t, data_time(m->in.sun.head, t.t), m->par.hold);
    if (seen) {
        quality = quality_min(quality, of_sun);
        error.sigma_BR = turn_to(s, vec_unit(m->par.axis_B));
        error.omega_RN_B = vec_scale(m->par.spin, s);
        error.domega_RN_B = vec3(0.0, 0.0, 0.0); /* the Sun rests in N */
    } else {
        quality = quality_min(quality, QUALITY_DEGRADED);
        error.sigma_BR = vec3(0.0, 0.0, 0.0);
        error.omega_RN_B = m->par.search_B;
        error.domega_RN_B = vec_cross(omega_BN, m->par.search_B); /* it rests in B */
    }
    error.omega_BR_B = vec_sub(omega_BN, error.omega_RN_B);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (quality != QUALITY_NONE && vec_finite(error.sigma_BR) && vec_finite(error.omega_BR_B) &&
        vec_finite(error.omega_RN_B) && vec_finite(error.domega_RN_B)) {
        m->mem.searched += !seen;
        error.head = head_next(out->head, t.t, quality);
        error.head.t = data_time(m->in.rate.head, t.t);
        *out = error;
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
/* options: -eva-slevel 60 */
#include "flight/guidance/hill_pointing.h"

#include <string.h>

#include "flight/math/attitude.h"

/* sin^2 of the angle between r and v below which rounding decides where h points. */
static const double RADIAL = 1e-24;

void hill_pointing_reset(HillPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* 0 if there is no such frame. */
static int hill_frame(Vec3 r, Vec3 v, AttReference *hill)
{
    Vec3 h = vec_cross(r, v);
    double r2 = vec_norm2(r);
    if (!(vec_norm2(h) > RADIAL * r2 * vec_norm2(v)) || !(r2 > 0.0)) { /* this refuses a NaN too */
        return 0;
    }
    Vec3 i_r = vec_unit(r);
    Vec3 i_h = vec_unit(h);
    hill->sigma_RN = dcm_to_mrp(mat_rows(i_r, vec_cross(i_h, i_r), i_h));
    hill->omega_RN_N = vec_scale(1.0 / r2, h);
    hill->domega_RN_N = vec_scale(-2.0 * vec_dot(r, v) / r2, hill->omega_RN_N);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return vec_finite(hill->sigma_RN) && vec_finite(hill->omega_RN_N) && vec_finite(hill->domega_RN_N);
}

void hill_pointing_update(HillPointing *m, Tick t)
{
    const NavOrbit *orbit = &m->in.orbit;
    const BodyState *planet = &m->in.planet; /* all zero if never written */
    AttReference *out = &m->out.reference;

    AttReference hill;
    Quality quality = quality_min(quality_through(orbit->head), quality_optional(planet->head));
    if (quality != QUALITY_NONE &&
        hill_frame(vec_sub(orbit->r_BN_N, planet->r_PN_N), vec_sub(orbit->v_BN_N, planet->v_PN_N), &hill)) {
        hill.head = head_next(out->head, t.t, quality);
        *out = hill;
    } else {
        out->head = head_held(out->head);
    }
}

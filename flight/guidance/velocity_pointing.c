/* SPDX-License-Identifier: Apache-2.0 */
/* options: -eva-slevel 60 */
#include "flight/guidance/velocity_pointing.h"

#include <string.h>

#include "flight/math/attitude.h"

/* sin^2 of the angle between r and v below which rounding decides where h points. */
static const double RADIAL = 1e-24;

void velocity_pointing_reset(VelocityPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* 0 if there is no such frame. */
static int velocity_frame(Vec3 r, Vec3 v, double mu, AttReference *frame)
{
    Vec3 h = vec_cross(r, v);
    double r2 = vec_norm2(r), v2 = vec_norm2(v);
    if (!(vec_norm2(h) > RADIAL * r2 * v2) || !(mu > 0.0)) { /* so is a NaN refused */
        return 0;
    }
    Vec3 i_v = vec_unit(v);
    Vec3 i_h = vec_unit(h);
    double bend = mu / (fm_sqrt(r2) * v2); /* 1 on a circle, 1/2 on a parabola, 0 at infinity */
    frame->sigma_RN = dcm_to_mrp(mat_rows(vec_cross(i_v, i_h), i_v, i_h));
    frame->omega_RN_N = vec_scale(bend / r2, h);
    frame->domega_RN_N = vec_scale((2.0 * bend - 3.0) * vec_dot(r, v) / r2, frame->omega_RN_N);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return vec_finite(frame->sigma_RN) && vec_finite(frame->omega_RN_N) && vec_finite(frame->domega_RN_N);
}

void velocity_pointing_update(VelocityPointing *m, Tick t)
{
    const NavOrbit *orbit = &m->in.orbit;
    const BodyState *planet = &m->in.planet; /* all zero if never written */
    AttReference *out = &m->out.reference;

    AttReference frame;
    Quality quality = quality_min(quality_through(orbit->head), quality_optional(planet->head));
    if (quality != QUALITY_NONE && velocity_frame(vec_sub(orbit->r_BN_N, planet->r_PN_N),
                                                  vec_sub(orbit->v_BN_N, planet->v_PN_N), m->par.mu, &frame)) {
        frame.head = head_next(out->head, t.t, quality);
        *out = frame;
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/seen_target.h"

#include <string.h>

#include "flight/math/attitude.h"

void seen_target_reset(SeenTarget *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void seen_target_update(SeenTarget *m, Tick t)
{
    const SeenCraft *seen = &m->in.seen;
    const NavAttitude *own = &m->in.own;
    const NavOrbit *orbit = &m->in.orbit;
    const double age = tick_seconds(tick_since(t.t, seen->head.t));
    const Quality quality = quality_min(quality_through(seen->head), quality_through(own->head));
    const int counts = quality != QUALITY_NONE && age >= 0.0 && age <= m->par.hold;

    /* [BN] when it was seen. */
    const Vec3 sigma_BN = mrp_compose(mrp_turn(vec_scale(-age, own->omega_BN_B)), own->sigma_BN);
    const Mat3 dcm_BN = mrp_to_dcm(sigma_BN);

    NavAttitude attitude;
    attitude.sigma_BN = mrp_compose(seen->sigma_TB, sigma_BN);
    attitude.omega_BN_B = mat_vec(mrp_to_dcm(seen->sigma_TB), vec_add(own->omega_BN_B, seen->omega_TB_B));
    if (counts && vec_finite(attitude.sigma_BN) && vec_finite(attitude.omega_BN_B)) {
        attitude.head = head_next(m->out.attitude.head, seen->head.t, quality);
        m->out.attitude = attitude;
    } else {
        m->out.attitude.head = head_held(m->out.attitude.head);
    }

    BodyState body;
    const Quality placed = quality_min(quality, quality_through(orbit->head));
    const Vec3 to_now = vec_add(seen->r_TB_B, vec_scale(age, seen->v_TB_B));
    body.r_PN_N = vec_add(orbit->r_BN_N, mat_transpose_vec(dcm_BN, to_now));
    body.v_PN_N = vec_add(orbit->v_BN_N, mat_transpose_vec(dcm_BN, seen->v_TB_B));
    body.a_PN_N = orbit->a_BN_N; /* of a neighbour, nearly */
    if (counts && placed != QUALITY_NONE && vec_finite(body.r_PN_N) && vec_finite(body.v_PN_N) &&
        vec_finite(body.a_PN_N)) {
        body.head = head_next(m->out.body.head, t.t, placed);
        m->out.body = body;
    } else {
        m->out.body.head = head_held(m->out.body.head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/base_reference.h"

#include <string.h>

#include "flight/math/attitude.h"

void base_reference_reset(BaseReference *m)
{
    memset(&m->out, 0, sizeof m->out);
}

static AttReference sensed_base(const NavAttitude *other)
{
    AttReference base;
    base.head = other->head;
    base.sigma_RN = other->sigma_BN;
    base.omega_RN_N = mat_transpose_vec(mrp_to_dcm(other->sigma_BN), other->omega_BN_B);
    base.domega_RN_N = vec3(0.0, 0.0, 0.0); /* a sensor sees none */
    return base;
}

void base_reference_update(BaseReference *m, Tick t)
{
    AttReference *out = &m->out.reference;
    const AttReference base = m->par.source == BASE_SENSED ? sensed_base(&m->in.sensed)
                              : m->par.source == BASE_OWN  ? m->in.own
                                                           : m->in.commanded;
    const double age = tick_seconds(tick_since(t.t, base.head.t));

    AttReference now;
    Vec3 gained = vec_scale(age, base.domega_RN_N);
    Vec3 phi = vec_scale(age, vec_add(base.omega_RN_N, vec_scale(0.5, gained)));
    now.head = head_next(out->head, t.t, quality_through(base.head));
    now.sigma_RN = mrp_compose(base.sigma_RN, mrp_turn(phi));
    now.omega_RN_N = vec_add(base.omega_RN_N, gained);
    now.domega_RN_N = base.domega_RN_N;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (head_written(base.head) && age <= m->par.hold && vec_finite(now.sigma_RN) && vec_finite(now.omega_RN_N) &&
        vec_finite(now.domega_RN_N)) {
        *out = now;
    } else {
        out->head = head_held(out->head);
    }
}

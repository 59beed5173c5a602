/* SPDX-License-Identifier: Apache-2.0 */
/* With phi = rate (t - start) in N components, [RN](t) = [R0N][M(phi)], as in BaseReference. */
#include "flight/guidance/burn_pointing.h"

#include <string.h>

#include "flight/math/attitude.h"

void burn_pointing_reset(BurnPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void burn_pointing_update(BurnPointing *m, Tick t)
{
    const DeltaVCommand *command = &m->in.command;
    AttReference *out = &m->out.reference;
    const Vec3 r1 = vec_unit(command->dv_N);
    Vec3 r2 = vec_cross(command->rate_N, r1);
    if (!(vec_norm2(r2) > 1e-12 * vec_norm2(command->rate_N))) {
        r2 = vec_cross(vec_far_axis(r1), r1);
    }
    r2 = vec_unit(r2);

    AttReference reference;
    const Vec3 phi = vec_scale(tick_seconds(tick_since(t.t, command->start)), command->rate_N);
    reference.sigma_RN = mrp_compose(dcm_to_mrp(mat_rows(r1, r2, vec_cross(r1, r2))), mrp_turn(phi));
    reference.omega_RN_N = command->rate_N;
    reference.domega_RN_N = vec3(0.0, 0.0, 0.0);
    const Quality quality = quality_through(command->head);
    /* undecided: a guard; no inputs are known at which this alone is 0 or not finite */
    if (quality != QUALITY_NONE && vec_norm2(r1) > 0.0 && vec_norm2(r2) > 0.0 && vec_finite(reference.sigma_RN) &&
        vec_finite(reference.omega_RN_N)) {
        reference.head = head_next(out->head, t.t, quality);
        *out = reference;
    } else {
        out->head = head_held(out->head);
    }
}

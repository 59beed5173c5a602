/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/delta_v_accumulation.h"

#include <string.h>

#include "flight/math/attitude.h"

void delta_v_accumulation_reset(DeltaVAccumulation *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* open sum: a_N is finite where its length is, as flight/math/vec_proof.c shows */
void delta_v_accumulation_update(DeltaVAccumulation *m, Tick t)
{
    DeltaVSum *out = &m->out.sum;
    const Quality quality = quality_min(quality_through(m->in.force.head), quality_through(m->in.attitude.head));
    const int64_t now = head_time(m->in.force.head, t.t);
    const int first = !head_written(out->head);

    DeltaVSum sum = *out;
    const Mat3 BN = mrp_to_dcm(m->in.attitude.sigma_BN);
    sum.a_N = mat_transpose_vec(BN, vec_sub(m->in.force.f_B, m->par.bias_B));
    sum.start = first ? now : out->start;
    if (!first) {
        const Vec3 biased_B = vec_scale(tick_seconds(tick_since(now, out->head.t)), m->par.bias_B);
        const Vec3 added_B = vec_sub(vec_sub(m->in.force.dv_B, m->mem.dv_B), biased_B);
        const Vec3 before_N = mat_transpose_vec(mrp_to_dcm(m->mem.sigma_BN), added_B);
        sum.dv_N = vec_add(sum.dv_N, vec_scale(0.5, vec_add(before_N, mat_transpose_vec(BN, added_B))));
        sum.path += vec_norm(added_B);
    }
    /* undecided: a guard; no inputs are known at which a sum alone is not finite */
    if (quality != QUALITY_NONE && (first || now >= out->head.t) && isfinite(vec_norm(sum.a_N)) &&
        isfinite(vec_norm(m->in.force.dv_B)) && vec_finite(sum.dv_N) && isfinite(sum.path)) {
        sum.head = head_next(out->head, now, quality);
        *out = sum;
        m->mem.dv_B = m->in.force.dv_B;
        m->mem.sigma_BN = m->in.attitude.sigma_BN;
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/delta_v_accumulation.h"

#include <string.h>

#include "flight/math/attitude.h"

void delta_v_accumulation_reset(DeltaVAccumulation *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void delta_v_accumulation_update(DeltaVAccumulation *m, Tick t)
{
    DeltaVSum *out = &m->out.sum;
    const Quality quality = quality_min(quality_through(m->in.force.head), quality_through(m->in.attitude.head));
    const int64_t now = head_time(m->in.force.head, t.t);
    const int first = !head_written(out->head);

    DeltaVSum sum = *out;
    sum.a_N = mat_transpose_vec(mrp_to_dcm(m->in.attitude.sigma_BN), vec_sub(m->in.force.f_B, m->par.bias_B));
    sum.start = first ? now : out->start;
    if (!first) {
        const double half = 0.5 * tick_seconds(tick_since(now, out->head.t));
        sum.dv_N = vec_add(sum.dv_N, vec_scale(half, vec_add(out->a_N, sum.a_N)));
        sum.path += half * (vec_norm(out->a_N) + vec_norm(sum.a_N));
    }
    if (quality != QUALITY_NONE && (first || now >= out->head.t) && isfinite(vec_norm(sum.a_N)) &&
        vec_finite(sum.dv_N) && isfinite(sum.path)) {
        sum.head = head_next(out->head, now, quality);
        *out = sum;
    } else {
        out->head = head_held(out->head);
    }
}

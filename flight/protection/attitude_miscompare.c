/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/attitude_miscompare.h"

#include <string.h>

#include "flight/math/attitude.h"
#include "flight/protection/persistence.h"

void attitude_miscompare_reset(AttitudeMiscompare *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Pass an attitude on; 0 where it was never written or its numbers are not finite. */
static int pass_on(NavAttitude *out, const NavAttitude *from, Quality quality)
{
    NavAttitude passed = *from;
    if (!head_written(passed.head) || !vec_finite(passed.sigma_BN) || !vec_finite(passed.omega_BN_B)) {
        return 0;
    }
    passed.head = head_next(out->head, passed.head.t, quality);
    *out = passed;
    return 1;
}

void attitude_miscompare_update(AttitudeMiscompare *m, Tick t)
{
    const NavAttitude *a = &m->in.a, *b = &m->in.b;
    NavAttitude *out = &m->out.attitude;
    const Quality quality = quality_min(a->head.quality, b->head.quality);
    const double angle = mrp_angle(mrp_relative(a->sigma_BN, b->sigma_BN)) / m->par.angle_max;
    const double rate = vec_norm(vec_sub(a->omega_BN_B, b->omega_BN_B)) / m->par.rate_max;
    const double worse = angle > rate || isnan(angle) ? angle : rate;
    const int64_t of_a = data_time(a->head, t.t), of_b = data_time(b->head, t.t);
    judge(&m->out.state, &m->mem.judgement, t.t, of_a < of_b ? of_a : of_b, quality, worse, m->par.persistence,
          m->par.release);

    const NavAttitude *used = m->par.prefer_b ? b : a, *other = m->par.prefer_b ? a : b;
    if (!pass_on(out, used, quality_through(used->head)) &&
        !pass_on(out, other, quality_min(quality_through(other->head), QUALITY_DEGRADED))) {
        out->head = head_held(out->head);
    }
}

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

static int good_numbers(const NavAttitude *attitude)
{
    return head_written(attitude->head) && vec_finite(attitude->sigma_BN) && vec_finite(attitude->omega_BN_B);
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
    Quality passed = quality_through(used->head);
    if (!good_numbers(used)) {
        used = other;
        passed = quality_min(quality_through(used->head), QUALITY_DEGRADED);
    }
    if (good_numbers(used)) {
        const Head last = out->head;
        *out = *used;
        out->head = head_next(last, used->head.t, passed);
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/gimbal_steering.h"

#include <string.h>

#include "flight/actuation/allocation.h"
#include "flight/math/elementary.h"

#define LAMBDA 0.01 /* where the gyros are singular */

void gimbal_steering_reset(GimbalSteering *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Gives the rates before their limit, and the lambda of the inverse. */
static double steer(const GimbalSteering *m, uint32_t n, double rates[WHEELS_MAX])
{
    Vec3 A[WHEELS_MAX], sum = vec3(0.0, 0.0, 0.0);
    Gram gram = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < n; i++) {
        const Vec3 s0 = vec_unit(m->par.spins_B[i]), t0 = vec_cross(vec_unit(m->par.axes_B[i]), s0);
        double sine, cosine;
        fm_sincos(m->in.gimbals.angle[i], &sine, &cosine);
        A[i] = vec_sub(vec_scale(cosine, t0), vec_scale(sine, s0));
        sum = vec_add(sum, vec_add(vec_scale(cosine, s0), vec_scale(sine, t0)));
        gram_add(&gram, A[i]);
    }
    const double det = gram.xx * (gram.yy * gram.zz - gram.yz * gram.yz) -
                       gram.xy * (gram.xy * gram.zz - gram.yz * gram.xz) +
                       gram.xz * (gram.xy * gram.yz - gram.yy * gram.xz);
    const double lambda = LAMBDA * fm_exp(-10.0 * det);
    gram.xx += lambda;
    gram.yy += lambda;
    gram.zz += lambda;
    int rank;
    const Vec3 wanted =
        vec_add(vec_scale(1.0 / m->par.H, m->in.torque.torque_B), vec_cross(m->in.rate.omega_BN_B, sum));
    const Vec3 y = mat_vec(gram_pinv(&gram, &rank), wanted);
    for (uint32_t i = 0; i < n; i++) {
        rates[i] = -vec_dot(A[i], y);
    }
    return lambda;
}

void gimbal_steering_update(GimbalSteering *m, Tick t)
{
    GimbalRates *out = &m->out.rates;
    const uint32_t n = m->par.n < (uint32_t)WHEELS_MAX ? m->par.n : (uint32_t)WHEELS_MAX;
    double rates[WHEELS_MAX] = {0.0}, limits[WHEELS_MAX];
    const double lambda = steer(m, n, rates);
    for (uint32_t i = 0; i < n; i++) {
        limits[i] = m->par.rate_max;
    }
    const double factor = within_limits(limits, rates, n);
    for (uint32_t i = 0; i < n; i++) {
        rates[i] *= factor;
    }

    Quality quality = quality_min(quality_through(m->in.torque.head), quality_through(m->in.rate.head));
    quality = quality_min(quality, quality_through(m->in.gimbals.head));
    if (lambda > 0.5 * LAMBDA) {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }
    const int acts = head_acting(&out->head, t, numbers_finite(rates, n) ? quality : QUALITY_NONE,
                                 data_time(m->in.torque.head, t.t), m->par.hold, &m->mem.newest);
    put_numbers(out->rate, rates, WHEELS_MAX, acts);
    m->mem.saturated += acts > 0 && factor < 1.0;
}

/* SPDX-License-Identifier: Apache-2.0 */
/* G^+ G d = G^T (G G^T)^+ G d, so that no matrix is larger than three. */
#include "flight/actuation/wheel_balance.h"

#include <string.h>

#include "flight/actuation/allocation.h"

void wheel_balance_reset(WheelBalance *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* N d; 0 for wheels that may not be used. */
static void null_motion(const WheelBalance *m, double null[WHEELS_MAX])
{
    const WheelSet *wheels = &m->in.wheels;
    const WheelAvailability *may = &m->in.availability;
    const double *wanted = head_written(m->in.wanted.head) ? m->in.wanted.Omega : m->par.Omega;
    const uint32_t n = wheels_count(wheels);

    Vec3 G[WHEELS_MAX], sum = vec3(0.0, 0.0, 0.0);
    Gram gram = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < n; i++) {
        const int use = may_use(may->head, may->available[i]);
        const Vec3 g = use ? wheels->axes_B[i] : vec3(0.0, 0.0, 0.0);
        null[i] = use ? -m->par.K * (m->in.speeds.Omega[i] - wanted[i]) : 0.0;
        sum = vec_add(sum, vec_scale(null[i], g));
        gram_add(&gram, g);
        G[i] = g;
    }
    int rank;
    const Vec3 y = mat_vec(gram_pinv(&gram, &rank), sum);
    for (uint32_t i = 0; i < n; i++) {
        null[i] -= vec_dot(G[i], y);
    }
}

/* The largest part of the null motion, up to 1, that keeps motors within their limits. */
static double part(const WheelSet *wheels, const double *u, const double *null)
{
    double k = 1.0;
    for (uint32_t i = 0; i < wheels_count(wheels); i++) {
        const double limit = wheels->u_max[i];
        const double room = null[i] > 0.0 ? limit - u[i] : limit + u[i];
        if (!(limit <= 0.0) && !(fm_abs(null[i]) * k <= room)) {
            k = room > 0.0 ? room / fm_abs(null[i]) : 0.0;
        }
    }
    return k;
}

void wheel_balance_update(WheelBalance *m, Tick t)
{
    const WheelCommand *in = &m->in.torques;
    WheelCommand *out = &m->out.command;
    Quality quality = quality_min(quality_through(in->head), quality_through(m->in.wheels.head));
    quality = quality_min(quality, quality_optional(m->in.availability.head));
    quality = quality_min(quality, quality_optional(m->in.wanted.head));
    const Quality of_speeds = quality_through(m->in.speeds.head);

    double u[WHEELS_MAX], null[WHEELS_MAX] = {0.0};
    const Head wanted = m->in.wanted.head;
    const int wanted_lost = head_written(wanted) && data_lost(t, data_time(wanted, t.t), m->par.hold);
    int balances =
        of_speeds != QUALITY_NONE && !data_lost(t, data_time(m->in.speeds.head, t.t), m->par.hold) && !wanted_lost;
    if (balances) {
        null_motion(m, null);
    }
    const double k = part(&m->in.wheels, in->u, null);
    for (uint32_t i = 0; i < WHEELS_MAX; i++) {
        u[i] = in->u[i] + k * null[i];
    }
    balances = balances && numbers_finite(u, WHEELS_MAX);
    if (quality != QUALITY_NONE && numbers_finite(in->u, WHEELS_MAX)) {
        quality = quality_min(quality, balances ? of_speeds : QUALITY_DEGRADED);
        out->head = head_next(out->head, t.t, quality);
        out->head.t = data_time(in->head, t.t);
        memcpy(out->u, balances ? u : in->u, sizeof u);
    } else {
        out->head = head_held(out->head);
    }
}

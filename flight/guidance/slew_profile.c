/* SPDX-License-Identifier: Apache-2.0 */
/* With S = [M(phi e)] [TN], the axes rest in their frames, e in T and S, u in S and R:
 *     omega_RN = omega_TN + dphi e + dchi u
 *     domega_RN = domega_TN + ddphi e + ddchi u + omega_TN x (dphi e) + omega_RN x (dchi u).
 * chi ends at 0, where the body has stopped. With f = x^3 - x^4 / 2, a ramp over the time T passes rate T f(x). */
#include "flight/guidance/slew_profile.h"

#include <string.h>

#include "flight/guidance/attitude_jump.h"

/* An angle with its derivatives. */
typedef struct Turn {
    double x, dx, ddx;
} Turn;

void slew_profile_reset(SlewProfile *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* From rest up to the rate, in the time T. */
static Turn ramp(double rate, double T, double t)
{
    const double x = t / T;
    return (Turn){rate * T * x * x * x * (1.0 - 0.5 * x), rate * x * x * (3.0 - 2.0 * x),
                  rate / T * 6.0 * x * (1.0 - x)};
}

/* chi */
static Turn stopping(const SlewProfile *m, double t)
{
    if (!(t < m->mem.stop)) {
        return (Turn){0.0, 0.0, 0.0};
    }
    const Turn back = ramp(m->mem.w, m->mem.stop, m->mem.stop - t); /* seen backwards, it rises */
    return (Turn){-back.x, back.dx, -back.ddx};
}

/* phi, from the angle to 0. */
static Turn turning(const SlewProfile *m, double t)
{
    const double left = 2.0 * m->mem.ramp + m->mem.coast - t;
    if (!(left > 0.0)) {
        return (Turn){0.0, 0.0, 0.0};
    }
    if (!(t > 0.0)) {
        return (Turn){m->mem.angle, 0.0, 0.0};
    }
    if (t < m->mem.ramp) {
        const Turn up = ramp(m->mem.peak, m->mem.ramp, t);
        return (Turn){m->mem.angle - up.x, -up.dx, -up.ddx};
    }
    if (left < m->mem.ramp) {
        const Turn back = ramp(m->mem.peak, m->mem.ramp, left);
        return (Turn){back.x, -back.dx, back.ddx};
    }
    return (Turn){m->mem.peak * (left - 0.5 * m->mem.ramp), -m->mem.peak, 0.0};
}

static void begin(SlewProfile *m, int64_t t)
{
    const NavAttitude *body = &m->in.attitude;
    const AttReference *target = &m->in.target;
    const Vec3 w_B = vec_sub(body->omega_BN_B, mat_vec(mrp_to_dcm(body->sigma_BN), target->omega_RN_N));
    m->mem.w = vec_norm(w_B);
    m->mem.u_R = vec_unit(w_B);
    m->mem.stop = 1.5 * m->mem.w / m->par.accel_max;
    const Vec3 stops = mrp_turn(vec_scale(0.5 * m->mem.w * m->mem.stop, m->mem.u_R));
    const Vec3 sigma = mrp_compose(stops, mrp_relative(body->sigma_BN, target->sigma_RN));
    m->mem.e_T = vec_unit(sigma);
    m->mem.angle = mrp_angle(sigma);
    const double peak = fm_sqrt(m->mem.angle * m->par.accel_max / 1.5); /* without a coast */
    m->mem.peak = peak > m->par.rate_max ? m->par.rate_max : peak;
    m->mem.ramp = 1.5 * m->mem.peak / m->par.accel_max;
    m->mem.coast = peak > m->par.rate_max ? m->mem.angle / m->mem.peak - m->mem.ramp : 0.0;
    m->mem.start = t;
    m->mem.quality = quality_through(body->head);
    m->mem.running = 1u;
    m->out.status.slews++;
}

static int jumps(const SlewProfile *m)
{
    const AttReference *before = &m->mem.last, *now = &m->in.target;
    const double age = tick_seconds(tick_since(now->head.t, before->head.t));
    const Vec3 rate = vec_add(before->omega_RN_N, vec_scale(age, before->domega_RN_N));
    return m->mem.running == 0u || attitude_jump(before, now) > m->par.jump ||
           (m->par.rate_jump > 0.0 && vec_norm(vec_sub(now->omega_RN_N, rate)) > m->par.rate_jump);
}

/* The reference at t [s] after the slew began. */
static void compose(SlewProfile *m, double t)
{
    const AttReference *target = &m->in.target;
    AttReference *out = &m->out.reference;
    const Turn chi = stopping(m, t), phi = turning(m, t - m->mem.stop);
    const Vec3 sigma_ST = mrp_turn(vec_scale(phi.x, m->mem.e_T));
    const Vec3 sigma_RS = mrp_turn(vec_scale(chi.x, m->mem.u_R));
    out->sigma_RN = mrp_compose(sigma_RS, mrp_compose(sigma_ST, target->sigma_RN));
    const Vec3 e_N = mat_transpose_vec(mrp_to_dcm(target->sigma_RN), m->mem.e_T);
    const Vec3 u_N = mat_transpose_vec(mrp_to_dcm(out->sigma_RN), m->mem.u_R);
    const Vec3 of_phi = vec_scale(phi.dx, e_N), of_chi = vec_scale(chi.dx, u_N);
    out->omega_RN_N = vec_add(target->omega_RN_N, vec_add(of_phi, of_chi));
    const Vec3 turned = vec_add(vec_cross(target->omega_RN_N, of_phi), vec_cross(out->omega_RN_N, of_chi));
    const Vec3 gained = vec_add(vec_scale(phi.ddx, e_N), vec_scale(chi.ddx, u_N));
    out->domega_RN_N = vec_add(target->domega_RN_N, vec_add(gained, turned));
    m->out.status.angle = phi.x;
}

/* open status: each is finite where the length is, and the reference, which is turned by the angle */
void slew_profile_update(SlewProfile *m, Tick t)
{
    SlewProfile next = *m;
    AttReference *out = &next.out.reference;
    SlewStatus *status = &next.out.status;
    Quality quality = quality_through(m->in.target.head);
    if (jumps(m)) {
        begin(&next, t.t);
    }
    next.mem.last = m->in.target;
    const double since = tick_seconds(tick_since(t.t, next.mem.start));
    const double length = next.mem.stop + 2.0 * next.mem.ramp + next.mem.coast;
    status->peak = next.mem.peak;
    if (since < length) {
        compose(&next, since);
        status->phase = SLEW_SLEWING;
        status->remaining = length - since;
        quality = quality_min(quality, next.mem.quality);
    } else {
        *out = m->in.target;
        status->phase = SLEW_TRACKING;
        status->remaining = status->angle = 0.0;
    }
    const int begun = next.mem.quality != QUALITY_NONE;
    if (begun && quality != QUALITY_NONE && isfinite(length) && vec_finite(out->sigma_RN) &&
        vec_finite(out->omega_RN_N) && vec_finite(out->domega_RN_N)) {
        out->head = head_next(m->out.reference.head, t.t, quality);
        status->head = head_next(m->out.status.head, t.t, quality);
        m->out = next.out;
        m->mem = next.mem;
    } else {
        m->out.reference.head = head_held(m->out.reference.head);
        m->out.status.head = head_held(m->out.status.head);
    }
}

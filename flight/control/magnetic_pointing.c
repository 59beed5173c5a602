/* SPDX-License-Identifier: Apache-2.0 */
/* A body with wheels of momentum h obeys, with H its momentum and h's, dH + omega_BN x H = L_rods + L_disturbance: only
 * rods change H. Where the pitch loop keeps the body with its reference, H is h_bias a besides what the orbit's rate
 * gives, and the direction of h is that of the pitch axis; so the momentum's error h - h_bias [BR] a is the wheels'
 * surplus along a, and h_bias times the tilt of a across it. */
#include "flight/control/magnetic_pointing.h"

#include <string.h>

#include "flight/control/wheel_momentum.h"
#include "flight/math/attitude.h"

void magnetic_pointing_reset(MagneticPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void magnetic_pointing_update(MagneticPointing *m, Tick t)
{
    const AttError *error = &m->in.error;
    const Vec3 zero = vec3(0.0, 0.0, 0.0), a = vec_unit(m->par.pitch_B), sigma = error->sigma_BR;
    const int turning = head_written(m->in.wheels.head) && head_written(m->in.speeds.head);
    Vec3 of_wheels = zero;
    Vec3 of_rods = vec_neg(vec_add(vec_scale(m->par.K, sigma), mat_vec(m->par.P, error->omega_BR_B)));
    if (turning) {
        const Vec3 h = wheel_momentum(&m->in.wheels, &m->in.speeds, zero);
        const Vec3 normal = mat_vec(mrp_to_dcm(sigma), a);
        const Vec3 wanted = vec_scale(m->par.h_bias, vec_add(normal, vec_scale(1.0 - vec_dot(normal, a), a)));
        of_rods = vec_sub(of_rods, vec_scale(vec_dot(of_rods, a), a));
        of_rods = vec_sub(of_rods, vec_scale(m->par.gain, vec_sub(h, wanted)));
        const double pitch = m->par.K_pitch * vec_dot(sigma, a) + m->par.P_pitch * vec_dot(error->omega_BR_B, a);
        of_wheels = vec_scale(-pitch, a);
    }

    const Head none = {0, QUALITY_NONE, 0};
    const Quality quality = torque_quality(error->head, error->head, none, m->in.wheels.head, m->in.speeds.head);
    const Quality known = vec_finite(of_rods) && vec_finite(of_wheels) ? quality : QUALITY_NONE;
    const int64_t of_error = data_time(error->head, t.t);
    const int64_t of = turning ? time_min(of_error, data_time(m->in.speeds.head, t.t)) : of_error;
    int64_t newest = m->mem.newest;
    torque_put(&m->out.wheels_torque, of_wheels, t, known, of, m->par.hold, &newest);
    torque_put(&m->out.torque, of_rods, t, known, of, m->par.hold, &m->mem.newest);
}

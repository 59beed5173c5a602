/* SPDX-License-Identifier: Apache-2.0 */
/* With (A.1), I domega_BN = -omega_BN x H + u + L, the torque leaves, for the derivative of omega_BD in B,
 *     I domega_BD = -omega_BD x H - P omega_BD - K_I z. */
#include "flight/control/rate_servo.h"

#include <string.h>

#include "flight/control/wheel_momentum.h"

void rate_servo_reset(RateServo *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* z grows by the trapezoid between two errors. The limit is on z, so that it does not wind up. */
static Vec3 integral(const RateServo *m, Vec3 omega_BD, Tick t)
{
    if (!(m->par.K_I > 0.0)) {
        return vec3(0.0, 0.0, 0.0);
    }
    Vec3 z = m->mem.z;
    if (m->mem.running) {
        z = vec_add(z, vec_scale(0.5 * tick_seconds(t.dt), vec_add(m->mem.omega_BD_B, omega_BD)));
    }
    return m->par.u_I_max > 0.0 ? vec_clamp(z, m->par.u_I_max / m->par.K_I) : z;
}

static Vec3 servo_torque(const RateServo *m, Vec3 omega_BD, Vec3 z)
{
    const AttError *error = &m->in.error;
    const Mat3 I = m->in.vehicle.I_B;
    const Vec3 omega_RN = error->omega_RN_B;
    const Vec3 omega_BN = vec_add(error->omega_BR_B, omega_RN);
    const Vec3 omega_DN = vec_sub(omega_BN, omega_BD);

    Vec3 H = mat_vec(I, omega_BN);
    if (head_written(m->in.wheels.head) && head_written(m->in.speeds.head)) {
        H = vec_add(H, wheel_momentum(&m->in.wheels, &m->in.speeds, omega_BN));
    }
    const Vec3 domega_DN =
        vec_add(m->in.command.domega_DR_B, vec_sub(error->domega_RN_B, vec_cross(omega_BN, omega_RN)));
    Vec3 u = vec_add(vec_cross(omega_DN, H), mat_vec(I, domega_DN));
    u = vec_sub(u, mat_vec(m->par.P, omega_BD));
    u = vec_sub(u, vec_scale(m->par.K_I, z));
    return vec_sub(u, m->in.external.torque_B); /* zero if never written */
}

void rate_servo_update(RateServo *m, Tick t)
{
    BodyTorque *out = &m->out.torque;
    const Head error = m->in.error.head, command = m->in.command.head;
    Quality quality =
        torque_quality(error, m->in.vehicle.head, m->in.external.head, m->in.wheels.head, m->in.speeds.head);
    quality = quality_min(quality, quality_through(command));

    const Vec3 omega_BD = vec_sub(m->in.error.omega_BR_B, m->in.command.omega_DR_B);
    const Vec3 z = integral(m, omega_BD, t);
    const Vec3 torque_B = servo_torque(m, omega_BD, z);
    const int computed = quality != QUALITY_NONE && vec_finite(torque_B);
    const int64_t of_error = data_time(error, t.t), of_command = data_time(command, t.t);
    const int64_t newest = !computed ? m->mem.newest : of_error < of_command ? of_error : of_command;
    if (head_written(out->head) && data_lost(t, newest, m->par.hold)) {
        out->head = head_next(out->head, t.t, QUALITY_DEGRADED);
        out->torque_B = vec3(0.0, 0.0, 0.0);
        m->mem.running = 0;
    } else if (computed) {
        out->head = head_next(out->head, t.t, quality);
        out->torque_B = torque_B;
        m->mem.z = z;
        m->mem.omega_BD_B = omega_BD;
        m->mem.newest = newest;
        m->mem.running = 1;
    } else {
        out->head = head_held(out->head);
        m->mem.running = 0;
    }
}

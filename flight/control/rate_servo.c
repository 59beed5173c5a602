/* SPDX-License-Identifier: Apache-2.0 */
/* On a body that moves by I domega_BN = -omega_BN x H + u + L, the torque leaves, for the derivative of omega_BD in B,
 *     I domega_BD = -omega_BD x H - P omega_BD - K_I z. */
#include "flight/control/rate_servo.h"

#include <string.h>

#include "flight/control/wheel_momentum.h"

void rate_servo_reset(RateServo *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static Vec3 servo_torque(const RateServo *m, Vec3 omega_BD, Vec3 z)
{
    const AttError *error = &m->in.error;
    const Mat3 I = m->in.vehicle.I_B;
    const Vec3 omega_RN = error->omega_RN_B;
    const Vec3 omega_BN = vec_add(error->omega_BR_B, omega_RN);
    const Vec3 omega_DN = vec_sub(omega_BN, omega_BD);
    const Vec3 H = total_momentum(I, &m->in.wheels, &m->in.speeds, omega_BN);
    const Vec3 domega_DN =
        vec_add(m->in.command.domega_DR_B, vec_sub(error->domega_RN_B, vec_cross(omega_BN, omega_RN)));
    Vec3 u = vec_add(vec_cross(omega_DN, H), mat_vec(I, domega_DN));
    u = vec_sub(u, mat_vec(m->par.P, omega_BD));
    u = vec_sub(u, vec_scale(m->par.K_I, z));
    return vec_sub(u, m->in.external.torque_B); /* zero if never written */
}

void rate_servo_update(RateServo *m, Tick t)
{
    const Head error = m->in.error.head, command = m->in.command.head;
    Quality quality =
        torque_quality(error, m->in.vehicle.head, m->in.external.head, m->in.wheels.head, m->in.speeds.head);
    quality = quality_min(quality, quality_through(command));

    const Vec3 omega_BD = vec_sub(m->in.error.omega_BR_B, m->in.command.omega_DR_B);
    const Vec3 z = error_integral(m->mem.z, m->mem.running, m->mem.omega_BD_B, omega_BD, t, m->par.K_I, m->par.u_I_max);
    m->mem.running = torque_put(&m->out.torque, servo_torque(m, omega_BD, z), t, quality,
                                time_min(data_time(error, t.t), data_time(command, t.t)), m->par.hold, &m->mem.newest);
    if (m->mem.running) {
        m->mem.z = z;
        m->mem.omega_BD_B = omega_BD;
    }
}

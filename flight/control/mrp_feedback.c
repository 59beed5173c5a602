/* SPDX-License-Identifier: Apache-2.0 */
/* MRP feedback. The torque on the body, all in B components, is
 *     -(K sigma_BR + P omega_BR + K_I z - omega_RN x H + I (omega_BN x omega_RN - domega_RN) + L)
 *     H = I omega_BN + G h,   h_i = J_i (omega_BN . g_i + Omega_i)                 (A.3), (A.4)
 * Put into (A.1) it leaves
 *     I domega_BR = -omega_BR x H - K sigma_BR - P omega_BR - K_I z
 * where domega_BR is the derivative in B. So V = omega_BR . I omega_BR / 2 + 2 K log(1 + sigma_BR^2)
 * falls as -omega_BR . P omega_BR while the integral term is off. */
#include "flight/control/mrp_feedback.h"

#include <string.h>

#include "flight/control/wheel_momentum.h"
#include "flight/math/attitude.h"

/* z grows by the trapezoid between two errors. Where the MRP changed to the shadow set in between,
 * the last error is taken in the set that the motion passed through. The limit on z, not on the
 * torque alone, is the anti-windup. */
static Vec3 integral(const MrpFeedback *m, Tick t)
{
    if (!(m->par.K_I > 0.0)) {
        return vec3(0.0, 0.0, 0.0);
    }
    Vec3 z = m->mem.z;
    if (m->mem.running) {
        Vec3 now = m->in.error.sigma_BR;
        Vec3 last = mrp_nearer(m->mem.sigma_BR, now);
        z = vec_add(z, vec_scale(0.5 * tick_seconds(t.dt), vec_add(last, now)));
    }
    if (m->par.u_I_max > 0.0) {
        double limit = m->par.u_I_max / m->par.K_I;
        z = vec_clamp(z, limit);
    }
    return z;
}

static Vec3 control_torque(const MrpFeedback *m, Vec3 z, int compensate_wheels)
{
    const AttError *error = &m->in.error;
    Mat3 I = m->in.vehicle.I_B;
    Vec3 omega_RN = error->omega_RN_B;
    Vec3 omega_BN = vec_add(error->omega_BR_B, omega_RN);

    Vec3 H = mat_vec(I, omega_BN);
    if (compensate_wheels) {
        H = vec_add(H, wheel_momentum(&m->in.wheels, &m->in.speeds, omega_BN));
    }
    Vec3 u = vec_scale(m->par.K, error->sigma_BR);
    u = vec_add(u, mat_vec(m->par.P, error->omega_BR_B));
    u = vec_add(u, vec_scale(m->par.K_I, z));
    u = vec_sub(u, vec_cross(omega_RN, H));
    u = vec_add(u, mat_vec(I, vec_sub(vec_cross(omega_BN, omega_RN), error->domega_RN_B)));
    u = vec_add(u, m->in.external.torque_B); /* zero if never written */
    return vec_neg(u);
}

void mrp_feedback_reset(MrpFeedback *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void mrp_feedback_update(MrpFeedback *m, Tick t)
{
    BodyTorque *out = &m->out.torque;
    int wheels = head_written(m->in.wheels.head);
    int speeds = head_written(m->in.speeds.head);

    Quality quality =
        torque_quality(m->in.error.head, m->in.vehicle.head, m->in.external.head, m->in.wheels.head, m->in.speeds.head);

    Vec3 z = integral(m, t);
    Vec3 torque_B = control_torque(m, z, wheels && speeds);
    int computed = quality != QUALITY_NONE && vec_finite(torque_B);
    int64_t newest = computed ? data_time(m->in.error.head, t.t) : m->mem.newest;
    if (head_written(out->head) && data_lost(t, newest, m->par.hold)) {
        out->head = head_next(out->head, t.t, QUALITY_DEGRADED);
        out->torque_B = vec3(0.0, 0.0, 0.0);
        m->mem.running = 0;
    } else if (computed) {
        out->head = head_next(out->head, t.t, quality);
        out->torque_B = torque_B;
        m->mem.z = z;
        m->mem.sigma_BR = m->in.error.sigma_BR;
        m->mem.newest = newest;
        m->mem.running = 1;
    } else {
        out->head = head_held(out->head);
        m->mem.running = 0;
    }
}

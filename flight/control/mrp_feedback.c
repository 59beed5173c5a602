/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/control/mrp_feedback.h"

#include <string.h>

#include "flight/control/wheel_momentum.h"
#include "flight/math/attitude.h"

static Vec3 control_torque(const MrpFeedback *m, Vec3 z)
{
    const AttError *error = &m->in.error;
    Mat3 I = m->in.vehicle.I_B;
    Vec3 omega_RN = error->omega_RN_B;
    Vec3 omega_BN = vec_add(error->omega_BR_B, omega_RN);
    Vec3 H = total_momentum(I, &m->in.wheels, &m->in.speeds, omega_BN);

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
    const AttError *error = &m->in.error;
    Quality quality =
        torque_quality(error->head, m->in.vehicle.head, m->in.external.head, m->in.wheels.head, m->in.speeds.head);

    /* Where the MRP changed to the shadow set, the last error is taken in the set that the motion passed through. */
    Vec3 last = mrp_nearer(m->mem.sigma_BR, error->sigma_BR);
    Vec3 z = error_integral(m->mem.z, m->mem.running, last, error->sigma_BR, t, m->par.K_I, m->par.u_I_max);
    m->mem.running = torque_put(&m->out.torque, control_torque(m, z), t, quality, data_time(error->head, t.t),
                                m->par.hold, &m->mem.newest);
    if (m->mem.running) {
        m->mem.z = z;
        m->mem.sigma_BR = error->sigma_BR;
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/control/rate_damping.h"

#include <string.h>

void rate_damping_reset(RateDamping *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void rate_damping_update(RateDamping *m, Tick t)
{
    Vec3 torque_B = vec_neg(mat_vec(m->par.P, m->in.gyro.omega_BN_B));
    const double size = vec_norm(torque_B);
    if (m->par.torque_max > 0.0 && size > m->par.torque_max) {
        torque_B = vec_scale(m->par.torque_max / size, torque_B);
    }

    const Quality quality = isfinite(size) ? quality_through(m->in.gyro.head) : QUALITY_NONE;
    torque_put(&m->out.torque, torque_B, t, quality, data_time(m->in.gyro.head, t.t), m->par.hold, &m->mem.newest);
}

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
    BodyTorque *out = &m->out.torque;
    Vec3 torque_B = vec_neg(mat_vec(m->par.P, m->in.gyro.omega_BN_B));
    const double size = vec_norm(torque_B);
    if (m->par.torque_max > 0.0 && size > m->par.torque_max) {
        torque_B = vec_scale(m->par.torque_max / size, torque_B);
    }

    const Quality quality = quality_through(m->in.gyro.head);
    const int computed = quality != QUALITY_NONE && isfinite(size) && vec_finite(torque_B);
    const int64_t newest = computed ? data_time(m->in.gyro.head, t.t) : m->mem.newest;
    if (head_written(out->head) && data_lost(t, newest, m->par.hold)) {
        out->head = head_next(out->head, t.t, QUALITY_DEGRADED);
        out->torque_B = vec3(0.0, 0.0, 0.0);
    } else if (computed) {
        m->mem.newest = newest;
        out->head = head_next(out->head, t.t, quality);
        out->torque_B = torque_B;
    } else {
        out->head = head_held(out->head);
    }
}

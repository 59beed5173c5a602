/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/momentum_dump.h"

#include <string.h>

void momentum_dump_reset(MomentumDump *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void momentum_dump_update(MomentumDump *m, Tick t)
{
    const WheelSet *wheels = &m->in.wheels;
    Vec3 surplus = vec_neg(m->par.h_wanted_B);
    for (uint32_t i = 0; i < wheels_count(wheels); i++) {
        surplus = vec_add(surplus, vec_scale(wheels->J[i] * m->in.speeds.Omega[i], wheels->axes_B[i]));
    }
    const double h = vec_norm(surplus);
    const int dumping = m->mem.dumping ? h > m->par.h_stop : h > m->par.h_start;
    Vec3 torque_B = vec_scale(dumping ? -m->par.gain : 0.0, surplus);
    const double size = vec_norm(torque_B);
    if (m->par.torque_max > 0.0 && size > m->par.torque_max) {
        torque_B = vec_scale(m->par.torque_max / size, torque_B);
    }

    const Quality quality = quality_min(quality_through(m->in.speeds.head), quality_through(wheels->head));
    if (torque_put(&m->out.torque, torque_B, t, isfinite(size) ? quality : QUALITY_NONE,
                   data_time(m->in.speeds.head, t.t), m->par.hold, &m->mem.newest)) {
        m->mem.dumps += dumping && !m->mem.dumping;
        m->mem.dumping = (uint32_t)dumping;
    }
}

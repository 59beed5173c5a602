/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/rod_torques.h"

#include "flight/actuation/rod_dipoles.h"

void rod_torques_reset(RodTorques *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* open achieved: a torque that is not finite has no quality, and is not written */
/* open command: each dipole is finite where their sum along the axes is, m_B */
void rod_torques_update(RodTorques *m, Tick t)
{
    const RodSet *rods = &m->in.rods;
    const Vec3 B = m->in.field.B_B;

    int rank;
    double dipole[RODS_MAX] = {0.0};
    const double B2 = vec_norm2(B);
    const int strong = fm_sqrt(B2) >= m->par.field_min;
    const Vec3 wanted = vec_scale(1.0 / B2, vec_cross(B, m->in.torque.torque_B));
    const double factor = rods_share(rods, wanted, dipole, &rank);
    const Vec3 m_B = rods_dipole(rods, dipole), torque_B = vec_cross(m_B, B);

    const Head torque = m->in.torque.head, field = m->in.field.head;
    Quality quality = quality_min(quality_through(torque), quality_through(field));
    quality = quality_min(quality, quality_through(rods->head));
    const int given = quality != QUALITY_NONE && isfinite(B2);
    /* undecided: a guard; the torque of a dipole that is not finite is not finite */
    const int computed = given && strong && vec_finite(torque_B) && vec_finite(m_B);
    if (rank < 3) {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }
    const int acts = rods_put(&m->out.command, &m->out.achieved, dipole, torque_B, t, given && !strong,
                              computed ? quality : QUALITY_NONE,
                              time_min(data_time(torque, t.t), data_time(field, t.t)), m->par.hold, &m->mem.newest);
    m->mem.saturated += acts > 0 && factor < 1.0;
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/rod_torques.h"

#include <string.h>

#include "flight/actuation/allocation.h"

void rod_torques_reset(RodTorques *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static void put_out(RodTorques *m, int64_t t, Quality quality, const double *dipole, Vec3 torque_B)
{
    m->out.command.head = head_next(m->out.command.head, t, quality);
    memcpy(m->out.command.dipole, dipole, sizeof m->out.command.dipole);
    m->out.achieved.head = head_next(m->out.achieved.head, t, quality);
    m->out.achieved.torque_B = torque_B;
}

void rod_torques_update(RodTorques *m, Tick t)
{
    const double none[RODS_MAX] = {0.0};
    const RodSet *rods = &m->in.rods;
    const Vec3 B = m->in.field.B_B;
    const uint32_t n = rods_count(rods);

    int rank;
    double dipole[RODS_MAX] = {0.0};
    Vec3 m_B = vec3(0.0, 0.0, 0.0);
    const double B2 = vec_norm2(B);
    const int strong = fm_sqrt(B2) >= m->par.field_min;
    const Vec3 wanted = vec_scale(1.0 / B2, vec_cross(B, m->in.torque.torque_B));
    Gram gram = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < n; i++) {
        gram_add(&gram, rods->axes_B[i]);
    }
    const Vec3 y = mat_vec(gram_pinv(&gram, &rank), wanted);
    for (uint32_t i = 0; i < n; i++) {
        dipole[i] = vec_dot(rods->axes_B[i], y);
    }
    const double factor = within_limits(rods->m_max, dipole, n);
    for (uint32_t i = 0; i < n; i++) {
        dipole[i] *= factor;
        m_B = vec_add(m_B, vec_scale(dipole[i], rods->axes_B[i]));
    }
    const Vec3 torque_B = vec_cross(m_B, B);

    const Head torque = m->in.torque.head, field = m->in.field.head;
    Quality quality = quality_min(quality_through(torque), quality_through(field));
    quality = quality_min(quality, quality_through(rods->head));
    const int given = quality != QUALITY_NONE && isfinite(B2);
    const int computed = given && strong && vec_finite(torque_B) && vec_finite(m_B);
    const int64_t of_torque = data_time(torque, t.t), of_field = data_time(field, t.t);
    const int64_t newest = !computed ? m->mem.newest : of_torque < of_field ? of_torque : of_field;
    const int lost = head_written(m->out.command.head) && data_lost(t, newest, m->par.hold);
    if (lost || (given && !strong)) {
        put_out(m, t.t, QUALITY_DEGRADED, none, vec3(0.0, 0.0, 0.0));
    } else if (computed) {
        m->mem.newest = newest;
        m->mem.saturated += factor < 1.0;
        put_out(m, t.t, rank == 3 ? quality : QUALITY_DEGRADED, dipole, torque_B);
    } else {
        m->out.command.head = head_held(m->out.command.head);
        m->out.achieved.head = head_held(m->out.achieved.head);
    }
}

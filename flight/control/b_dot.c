/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/control/b_dot.h"

#include <string.h>

void b_dot_reset(BDot *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/** Whether the rods rest at t, in a cycle that it begins where the one before has ended. */
static int rests(BDot *m, int64_t t)
{
    double in_cycle = tick_seconds(tick_since(t, m->mem.begin));
    if (m->mem.running == 0u || in_cycle < 0.0 || in_cycle >= m->par.measure + m->par.act) {
        m->mem.running = 1u;
        m->mem.begin = t;
        m->mem.readings = m->mem.known = 0u; /* they are from before the rods acted */
        in_cycle = 0.0;
    }
    return in_cycle < m->par.measure;
}

/** Take a reading of the field, and of the gyro, and put out the rate across the field where they tell it. */
static void take(BDot *m, int64_t t)
{
    const MeasuredField *field = &m->in.field;
    const Vec3 B = field->B_B, omega = m->in.gyro.omega_BN_B;
    const double B2 = vec_norm2(B), strength = fm_sqrt(B2);
    const int64_t read = head_time(field->head, t);
    const double dt = m->mem.readings != 0u ? tick_seconds(tick_since(read, m->mem.last)) : 1.0;
    Quality quality = quality_through(field->head);
    if (quality == QUALITY_NONE || !vec_finite(B) || strength < m->par.field_min || dt <= 0.0) {
        return;
    }
    const int turns = gyro_speaks(&m->in.gyro);
    const Vec3 middle = vec_add(B, m->mem.B_B); /* twice the mean */
    Vec3 w = vec_scale(2.0 / (dt * vec_norm2(middle)), vec_cross(vec_sub(B, m->mem.B_B), middle));
    if (turns) {
        w = vec_sub(omega, vec_scale(vec_dot(omega, B) / B2, B));
    }
    if (head_written(m->in.gyro.head)) { /* a silent one degrades */
        quality = quality_min(quality, turns ? quality_through(m->in.gyro.head) : QUALITY_DEGRADED);
    }
    m->mem.readings += m->mem.readings < 2u;
    m->mem.B_B = B;
    m->mem.last = read;
    m->out.measured.B_B = B;
    m->out.measured.head = head_next(m->out.measured.head, read, quality_through(field->head));
    if ((turns || m->mem.readings == 2u) && vec_finite(w)) {
        m->mem.known = 1u;
        m->out.rate.omega_BN_B = w;
        m->out.rate.head = head_next(m->out.rate.head, read, quality);
    }
}

void b_dot_update(BDot *m, Tick t)
{
    const int cycles = m->par.act > 0.0, measures = cycles && rests(m, t.t);
    BodyTorque *torque = &m->out.torque;
    if (measures || !cycles) {
        take(m, t.t);
    }
    const int lost = !measures && (m->mem.known == 0u || (!cycles && data_lost(t, m->mem.last, m->par.hold)));
    const Quality quality = measures ? quality_through(m->in.field.head) : m->out.rate.head.quality;
    torque->torque_B = vec_scale(lost || measures ? 0.0 : -m->par.gain, m->out.rate.omega_BN_B);
    torque->head = head_next(torque->head, t.t, lost || quality == QUALITY_NONE ? QUALITY_DEGRADED : quality);
}

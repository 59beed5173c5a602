/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/b_dot.h"

#include "flight/actuation/rod_dipoles.h"

void b_dot_reset(BDot *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Takes a measurement of a new time: the change of its direction, as a vector across it. */
static void take_field(BDot *m, Vec3 b, int64_t at)
{
    const double step = tick_seconds(tick_since(at, m->mem.measured));
    const int compared = m->mem.known && (!(m->par.gap > 0.0) || step <= m->par.gap);
    if (compared) {
        const Vec3 change = vec_scale(1.0 / step, vec_sub(b, m->mem.b_B));
        const double part = m->mem.known == 2u && m->par.tau > 0.0 ? step / (step + m->par.tau) : 1.0;
        const Vec3 db = vec_add(m->mem.db_B, vec_scale(part, vec_sub(change, m->mem.db_B)));
        m->mem.db_B = vec_sub(db, vec_scale(vec_dot(db, b), b));
    }
    m->mem.known = compared ? 2u : 1u;
    m->mem.b_B = b;
    m->mem.measured = at;
}

/* The dipoles of the rods, each at its limit against its part of d where d is large; the factor of their limits. */
static double share_dipole(const BDot *m, Vec3 d, double B, double *dipole, int *rank)
{
    const RodSet *rods = &m->in.rods;
    const double factor = rods_share(rods, vec_scale(-m->par.k / B, d), dipole, rank);
    if (!(m->par.bang_above > 0.0 && vec_norm(d) > m->par.bang_above)) {
        return factor;
    }
    for (uint32_t i = 0; i < rods_count(rods); i++) {
        const double along = vec_dot(rods->axes_B[i], d);
        dipole[i] = along > 0.0 ? -rods->m_max[i] : along < 0.0 ? rods->m_max[i] : 0.0;
    }
    return 1.0;
}

static void put_state(BDot *m, int64_t t, Quality quality, double rate, int gyro)
{
    DetumbleState *state = &m->out.state;
    const int slow = rate < m->par.rate_slow;
    m->mem.slow_since = slow && m->mem.slow ? m->mem.slow_since : t;
    m->mem.slow = (uint32_t)slow;
    state->head = head_next(state->head, t, quality);
    state->rate = rate;
    state->slow_for = tick_seconds(tick_since(t, m->mem.slow_since));
    state->detumbled = slow && state->slow_for >= m->par.slow_time;
    state->gyro = (uint32_t)gyro;
}

/* open achieved: a torque that is not finite has no quality, and is not written */
/* open command: each dipole is finite where their sum along the axes is, m_B */
/* open state: directions are unit vectors, and change in 1 ns at least: |d| < 3e9 1/s */
void b_dot_update(BDot *m, Tick t)
{
    const Head field = m->in.field.head, gyro = m->in.gyro.head;
    const Vec3 B = m->in.field.B_B, omega = m->in.gyro.omega_BN_B;
    const double size = vec_norm(B);
    const int speaks = gyro_speaks(&m->in.gyro), seen = head_written(field) && isfinite(size);
    const int strong = size >= m->par.field_min && size > 0.0;
    const Vec3 b = vec_unit(B);
    const int64_t at = head_time(field, t.t);
    if (seen && strong && (!m->mem.known || at > m->mem.measured)) {
        take_field(m, b, at); /* the next output needs it, even if this one is not written */
    }

    int rank;
    double dipole[RODS_MAX] = {0.0};
    const Vec3 d = speaks ? vec_cross(b, omega) : m->mem.db_B;
    const double factor = share_dipole(m, d, size, dipole, &rank);
    const Vec3 m_B = rods_dipole(&m->in.rods, dipole), torque_B = vec_cross(m_B, B);

    Quality quality = quality_min(quality_through(field), quality_through(m->in.rods.head));
    const int given = quality != QUALITY_NONE && seen;
    quality = quality_min(quality, speaks ? quality_through(gyro) : head_written(gyro) ? QUALITY_DEGRADED : quality);
    /* undecided: a guard; the torque of a dipole that is not finite is not finite */
    const int computed = given && strong && (speaks || m->mem.known == 2u) && vec_finite(torque_B) && vec_finite(m_B);
    const int64_t of = speaks ? time_min(data_time(field, t.t), data_time(gyro, t.t)) : m->mem.measured;
    const Quality least = rank == 3 ? quality : quality_min(quality, QUALITY_DEGRADED);
    const int acts = rods_put(&m->out.command, &m->out.achieved, dipole, torque_B, t, given && !strong,
                              computed ? least : QUALITY_NONE, of, m->par.hold, &m->mem.newest);
    if (acts > 0) {
        m->mem.saturated += factor < 1.0;
        put_state(m, t.t, quality, speaks ? vec_norm(omega) : vec_norm(d), speaks);
    } else {
        m->out.state.head = head_held(m->out.state.head);
        m->mem.slow = acts == 0 ? 0u : m->mem.slow;
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Each sun sensor i looks along n_i = (+-1, +-1, +-1) / sqrt(3) and gives I n_i . s where this is positive. Of opposite
 * sensors one gives n . s, the other nothing, so the sum of n_i (n_i . s) over those that are lit is 4/3 s. */
#include "flight/avionics.h"

#include "flight/math/vec.h"

#include <string.h>

static Vec3 towards_sun(const SensorCurrents *sun)
{
    Vec3 sum = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0u; i < SUN_SENSORS; i++) {
        const Vec3 n = vec3(i & 1u ? 1.0 : -1.0, i & 2u ? 1.0 : -1.0, i & 4u ? 1.0 : -1.0);
        sum = vec_add(sum, vec_scale(sun->saturated[i] ? 0.0 : sun->current[i], n));
    }
    return vec_unit(sum);
}

void avionics_reset(Avionics *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void avionics_update(Avionics *m, Tick t)
{
    const Quality quality = quality_through(m->in.sun.head);
    const Vec3 s = towards_sun(&m->in.sun);
    if (quality != QUALITY_NONE && vec_finite(s)) {
        m->out.direction.head = head_next(m->out.direction.head, t.t, quality);
        memcpy(m->out.direction.s_B, s.v, sizeof s.v);
    } else {
        m->out.direction.head = head_held(m->out.direction.head);
    }

    m->out.volts.head = head_next(m->out.volts.head, t.t, quality_through(m->in.torques.head));
    for (uint32_t i = 0u; i < MOTORS; i++) {
        m->out.volts.volts[i] = m->in.torques.u[i] / m->par.motor;
    }

    uint32_t cards = 0u;
    for (uint32_t i = 0u; i < CARDS; i++) {
        const double limit = m->par.cold + (m->in.reply.cards >> i & 1u ? m->par.warm : 0.0);
        const int cold = head_written(m->in.cards.head) && m->in.cards.temperature[i] < limit;
        cards |= (uint32_t)(cold && m->in.bus.volts > m->par.volts_min) << i;
    }
    /* The next command only when the last one was answered. */
    m->out.power.head = head_next(m->out.power.head, t.t, QUALITY_GOOD);
    if (m->in.reply.number == m->out.power.number && cards != m->in.reply.cards) {
        m->out.power.number++;
        m->out.power.cards = cards;
    }

    const uint32_t mode = head_written(m->in.request.head) ? m->in.request.mode : 0u;
    m->mem.updates = mode == m->out.mode.mode ? m->mem.updates + 1u : 0u;
    m->out.mode.mode = mode;
    m->out.mode.head = head_next(m->out.mode.head, t.t, QUALITY_GOOD);

    m->out.burn.head = head_next(m->out.burn.head, t.t, QUALITY_GOOD);
    m->out.burn.duration = 0.0;
    if (mode == 2u && m->mem.updates % 8u == 0u && m->in.recorder.fill < 0.5) {
        m->out.burn.duration = 0.01 * (double)(1u + m->out.burn.number % 5u);
        m->out.burn.thruster = m->out.burn.number % 12u;
        m->out.burn.number++;
    }
}

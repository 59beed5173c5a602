/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/gyro_rates.h"

#include <string.h>

void gyro_rates_reset(GyroRates *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Counts turned from one reading to the next, at most half the range either way. */
static int64_t turned(uint32_t from, uint32_t to, uint32_t bits)
{
    const int64_t range = INT64_C(1) << bits;
    const int64_t counts = (int64_t)((to - from) & (uint32_t)(range - 1));
    return counts < range / 2 ? counts : counts - range;
}

void gyro_rates_update(GyroRates *m, Tick t)
{
    const GyroRegisters *r = &m->in.registers;
    GyroRate *out = &m->out.rate;
    if (!head_written(r->head) || (m->mem.known != 0u && r->counter == m->mem.counter)) {
        out->head = head_held(out->head);
        return;
    }
    const int64_t passed = (int64_t)(r->time - m->mem.time) * m->par.tick;
    const int first = m->mem.known == 0u || (int32_t)(r->counter - m->mem.counter) < 0 || passed <= 0;
    const double since = tick_seconds(passed > 0 ? passed : 1);
    Vec3 rate = vec3(0.0, 0.0, 0.0);
    int holds = !first;
    for (int i = 0; i < 3; i++) {
        const double counts = (double)turned(m->mem.angle[i], r->angle[i], m->par.bits);
        rate.v[i] = first ? 0.0 : counts * m->par.scale / since;
        holds = holds && (!(m->par.rate_max > 0.0) || fabs(rate.v[i]) <= m->par.rate_max);
        m->mem.angle[i] = r->angle[i];
    }
    m->mem.refused += !first && !holds;
    m->mem.time = r->time;
    m->mem.counter = r->counter;
    m->mem.known = r->counter > 0u;
    if (holds) {
        out->omega_BN_B = rate;
        out->head = head_next(out->head, tag_time(r->time, m->par.tick, t.t), quality_through(r->head));
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/wheel_monitor.h"

#include <string.h>

void wheel_monitor_reset(WheelMonitor *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void wheel_monitor_update(WheelMonitor *m, Tick t)
{
    const WheelSet *wheels = &m->in.wheels;
    const Head speeds = m->in.speeds.head;
    WheelAvailability *availability = &m->out.availability;
    ProtectionState *state = &m->out.state;
    const Quality quality = quality_min(quality_through(speeds), quality_through(wheels->head));
    const int64_t now = head_time(speeds, t.t);
    const double dt = tick_seconds(tick_since(now, m->mem.last));
    const int judges = quality != QUALITY_NONE && m->mem.running && dt > 0.0 && head_written(m->in.command.head);

    uint32_t working = 0u;
    for (uint32_t i = 0u; i < wheels_count(wheels); i++) {
        working += !((m->mem.faulty | m->par.off) >> i & 1u);
    }
    double worst = 0.0;
    uint32_t most = 0u;
    for (uint32_t i = 0u; judges && i < wheels_count(wheels); i++) {
        if (m->mem.faulty >> i & 1u) {
            continue;
        }
        const double shown = wheels->J[i] * (m->in.speeds.Omega[i] - m->mem.Omega[i]) / dt;
        const double missing = fm_abs(shown - m->in.command.u[i]) / m->par.torque_max;
        const int beyond = !(missing <= 1.0); /* so is a NaN */
        m->mem.count[i] = beyond ? m->mem.count[i] + 1u : 0u;
        if (m->mem.count[i] >= m->par.persistence && working > m->par.least) {
            working--;
            m->mem.faulty |= 1u << i;
            state->trips++;
        }
        worst = missing > worst ? missing : worst;
        most = m->mem.count[i] > most ? m->mem.count[i] : most;
    }
    if (quality != QUALITY_NONE && (dt > 0.0 || !m->mem.running)) {
        memcpy(m->mem.Omega, m->in.speeds.Omega, sizeof m->mem.Omega);
        m->mem.last = now;
        m->mem.running = 1u;
    }
    const uint32_t out_of_use = (m->mem.faulty & ~m->par.on) | m->par.off;
    for (uint32_t i = 0u; i < WHEELS_MAX; i++) {
        availability->available[i] = i < wheels_count(wheels) && !(out_of_use >> i & 1u);
    }
    state->tripped = m->mem.faulty != 0u;
    state->unknown += !judges;
    if (judges && isfinite(worst)) {
        state->value = worst;
        state->count = most;
    }
    const Quality known = head_written(wheels->head) && quality != QUALITY_NONE ? quality : QUALITY_DEGRADED;
    state->head = head_next(state->head, t.t, judges ? known : QUALITY_DEGRADED);
    if (head_written(wheels->head)) {
        availability->head = head_next(availability->head, t.t, known);
    }
}

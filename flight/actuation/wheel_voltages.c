/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/wheel_voltages.h"

#include <string.h>

#include "flight/actuation/allocation.h"
#include "flight/actuation/motor.h"

void wheel_voltages_reset(WheelVoltages *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void wheel_voltages_update(WheelVoltages *m, Tick t)
{
    const WheelSet *wheels = &m->in.wheels;
    const WheelAvailability *may = &m->in.availability;
    const int has_speeds = head_written(m->in.speeds.head);
    const int uses = m->par.back_emf > 0.0 || m->par.gain > 0.0;
    Quality quality = quality_min(quality_through(m->in.command.head), quality_through(wheels->head));
    quality = quality_min(quality, quality_optional(may->head));
    if (uses) {
        quality = quality_min(quality, has_speeds ? quality_through(m->in.speeds.head) : QUALITY_DEGRADED);
    }

    const int64_t taken = head_time(m->in.speeds.head, t.t);
    const double dt = tick_seconds(tick_since(taken, m->mem.taken));
    double volts[WHEELS_MAX] = {0.0};
    uint32_t knows = 0u, limited = 0u;
    for (uint32_t i = 0u; i < wheels_count(wheels) && quality != QUALITY_NONE; i++) {
        double u = m->in.command.u[i];
        if (!may_use(may->head, may->available[i])) {
            continue;
        }
        if (has_speeds && (m->mem.knows >> i & 1u) && m->par.gain > 0.0 && dt > 0.0) {
            const double shown = wheels->J[i] * (m->in.speeds.Omega[i] - m->mem.Omega[i]) / dt;
            u += m->par.gain * (m->mem.u[i] - shown);
        }
        const double Omega = has_speeds && uses ? m->in.speeds.Omega[i] : 0.0;
        double V = motor_volts(u, Omega, m->par.resistance, m->par.torque_constant, m->par.back_emf);
        V += u > 0.0 ? m->par.dead : u < 0.0 ? -m->par.dead : 0.0;
        if (!isfinite(V)) {
            quality = QUALITY_NONE;
        }
        knows |= has_speeds ? 1u << i : 0u;
        limited |= fm_abs(V) > m->par.volts_max;
        volts[i] = fm_clamp(V, m->par.volts_max);
    }
    WheelVolts *out = &m->out.drive;
    const int64_t newest = quality != QUALITY_NONE ? data_time(m->in.command.head, t.t) : m->mem.newest;
    if (head_written(out->head) && data_lost(t, newest, m->par.hold)) {
        out->head = head_next(out->head, t.t, QUALITY_DEGRADED);
        memset(out->volts, 0, sizeof out->volts);
        m->mem.knows = 0u;
    } else if (quality != QUALITY_NONE) {
        m->mem.saturated += limited;
        m->mem.newest = newest;
        memcpy(m->mem.u, m->in.command.u, sizeof m->mem.u);
        memcpy(m->mem.Omega, m->in.speeds.Omega, sizeof m->mem.Omega);
        m->mem.taken = taken;
        m->mem.knows = knows;
        out->head = head_next(out->head, t.t, quality);
        memcpy(out->volts, volts, sizeof volts);
    } else {
        out->head = head_held(out->head);
    }
}

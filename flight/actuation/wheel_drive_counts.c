/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/wheel_drive_counts.h"

#include <string.h>

#include "flight/math/vec.h"

void wheel_drive_counts_reset(WheelDriveCounts *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void wheel_drive_counts_update(WheelDriveCounts *m, Tick t)
{
    const double end = (double)(1 << (m->par.bits - 1u));
    const int knows_speeds = head_written(m->in.speeds.head);
    Quality quality = quality_through(m->in.command.head);
    quality = quality_min(quality, quality_optional(m->in.speeds.head));
    int32_t counts[WHEELS_MAX];
    uint64_t limited = 0u;
    for (uint32_t i = 0u; i < WHEELS_MAX; i++) {
        const double Omega = knows_speeds ? m->in.speeds.Omega[i] : 0.0;
        const double V = m->par.resistance * m->in.command.u[i] / m->par.torque_constant + m->par.back_emf * Omega;
        double x = V / m->par.volts * end;
        if (!isfinite(x)) {
            quality = QUALITY_NONE;
            x = 0.0;
        }
        limited |= x > end - 0.5 || x < -end - 0.5;
        x = x > end - 1.0 ? end - 1.0 : x < -end ? -end : x;
        counts[i] = (int32_t)(x < 0.0 ? x - 0.5 : x + 0.5);
    }
    WheelDrive *out = &m->out.drive;
    const int acts =
        head_acting(&out->head, t, quality, data_time(m->in.command.head, t.t), m->par.hold, &m->mem.newest);
    for (uint32_t i = 0u; i < WHEELS_MAX && acts >= 0; i++) {
        out->counts[i] = acts ? counts[i] : 0;
    }
    m->mem.saturated += acts > 0 && limited;
}

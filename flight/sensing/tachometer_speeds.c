/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/tachometer_speeds.h"

#include <string.h>

void tachometer_speeds_reset(TachometerSpeeds *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void tachometer_speeds_update(TachometerSpeeds *m, Tick t)
{
    const Quality quality = quality_through(m->in.tachometers.head);
    if (quality == QUALITY_NONE) {
        m->out.speeds.head = head_held(m->out.speeds.head);
        return;
    }
    const double count = 6.283185307179586 / ((double)m->par.marks * tick_seconds(m->par.window)); /* [rad/s] */
    for (uint32_t i = 0u; i < WHEELS_MAX; i++) {
        m->out.speeds.Omega[i] = count * (double)m->in.tachometers.counts[i];
    }
    m->out.speeds.head = head_next(m->out.speeds.head, t.t, quality);
}

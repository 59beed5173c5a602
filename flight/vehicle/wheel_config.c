/* SPDX-License-Identifier: Apache-2.0 */
/* Publishes the wheels' data, with unit axes. */
#include "flight/vehicle/wheel_config.h"

#include <string.h>

void wheel_config_reset(WheelConfig *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void wheel_config_update(WheelConfig *m, Tick t)
{
    WheelSet *out = &m->out.wheels;
    WheelSet wheels;
    int finite = 1;
    int whole = m->par.n <= WHEELS_MAX;

    memset(&wheels, 0, sizeof wheels);
    wheels.n = whole ? m->par.n : WHEELS_MAX;
    for (uint32_t i = 0; i < wheels.n; i++) {
        Vec3 axis = vec_unit(m->par.axes_B[i]);
        wheels.axes_B[i] = axis;
        wheels.J[i] = m->par.J[i];
        wheels.u_max[i] = m->par.u_max[i];
        finite = finite && vec_finite(m->par.axes_B[i]) && isfinite(wheels.J[i]) && isfinite(wheels.u_max[i]);
        whole = whole && vec_norm2(axis) > 0.0;
    }
    if (finite) {
        wheels.head = head_next(out->head, t.t, whole ? QUALITY_GOOD : QUALITY_DEGRADED);
        *out = wheels;
    } else {
        out->head = head_held(out->head);
    }
}

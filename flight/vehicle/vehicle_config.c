/* SPDX-License-Identifier: Apache-2.0 */
/* Publishes the vehicle's data. */
#include "flight/vehicle/vehicle_config.h"

#include <string.h>

void vehicle_config_reset(VehicleConfig *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void vehicle_config_update(VehicleConfig *m, Tick t)
{
    VehicleData *out = &m->out.vehicle;
    if (mat_finite(m->par.I_B)) {
        out->head = head_next(out->head, t.t, QUALITY_GOOD);
        out->I_B = m->par.I_B;
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Publishes the rods' data. */
#include "flight/vehicle/rod_config.h"

#include <string.h>

void rod_config_reset(RodConfig *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void rod_config_update(RodConfig *m, Tick t)
{
    RodSet *out = &m->out.rods;
    RodSet rods;
    int finite = 1;
    int whole = m->par.n <= RODS_MAX;

    memset(&rods, 0, sizeof rods);
    rods.n = whole ? m->par.n : RODS_MAX;
    for (uint32_t i = 0; i < rods.n; i++) {
        rods.axes_B[i] = vec_unit(m->par.axes_B[i]);
        rods.m_max[i] = m->par.m_max[i];
        finite = finite && vec_finite(m->par.axes_B[i]) && isfinite(rods.m_max[i]);
        whole = whole && vec_norm2(rods.axes_B[i]) > 0.0;
    }
    if (finite) {
        rods.head = head_next(out->head, t.t, whole ? QUALITY_GOOD : QUALITY_DEGRADED);
        *out = rods;
    } else {
        out->head = head_held(out->head);
    }
}

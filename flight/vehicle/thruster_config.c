/* SPDX-License-Identifier: Apache-2.0 */
/* Publishes the thrusters' data. */
#include "flight/vehicle/thruster_config.h"

#include <string.h>

void thruster_config_reset(ThrusterConfig *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void thruster_config_update(ThrusterConfig *m, Tick t)
{
    ThrusterSet *out = &m->out.thrusters;
    ThrusterSet set;
    int finite = 1;
    int whole = m->par.n <= THRUSTERS_MAX;

    memset(&set, 0, sizeof set);
    set.n = whole ? m->par.n : THRUSTERS_MAX;
    for (uint32_t i = 0; i < set.n; i++) {
        set.r_TC_B[i] = vec_sub(m->par.r_TB_B[i], m->par.r_CB_B);
        set.axes_B[i] = vec_unit(m->par.axes_B[i]);
        set.F_max[i] = m->par.F_max[i];
        finite = finite && vec_finite(set.r_TC_B[i]) && vec_finite(m->par.axes_B[i]) && isfinite(set.F_max[i]);
        whole = whole && vec_norm2(set.axes_B[i]) > 0.0;
    }
    if (finite) {
        set.head = head_next(out->head, t.t, whole ? QUALITY_GOOD : QUALITY_DEGRADED);
        *out = set;
    } else {
        out->head = head_held(out->head);
    }
}

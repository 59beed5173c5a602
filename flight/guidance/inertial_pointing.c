/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/inertial_pointing.h"

#include <string.h>

#include "flight/math/attitude.h"

void inertial_pointing_reset(InertialPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void inertial_pointing_update(InertialPointing *m, Tick t)
{
    AttReference *out = &m->out.reference; /* no code sets its rates, so they stay zero */
    Vec3 sigma_RN = mrp_short(m->par.sigma_RN);
    if (vec_finite(sigma_RN)) {
        out->head = head_next(out->head, t.t, QUALITY_GOOD);
        out->sigma_RN = sigma_RN;
    } else {
        out->head = head_held(out->head);
    }
}

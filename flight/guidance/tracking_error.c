/* SPDX-License-Identifier: Apache-2.0 */
/* The attitude error against a reference for a body-fixed control frame. R is fixed in Ri, so both
 * have the same angular rate and acceleration, which are only mapped to B. */
#include "flight/guidance/tracking_error.h"

#include <string.h>

#include "flight/math/attitude.h"

void tracking_error_reset(TrackingError *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void tracking_error_update(TrackingError *m, Tick t)
{
    const NavAttitude *body = &m->in.attitude;
    const AttReference *reference = &m->in.reference;
    AttError *out = &m->out.error;

    AttError error;
    Quality quality = quality_min(quality_through(body->head), quality_through(reference->head));
    Vec3 sigma_RN = mrp_compose(vec_neg(m->par.sigma_BcB), reference->sigma_RN);
    Mat3 dcm_BN = mrp_to_dcm(body->sigma_BN);
    error.sigma_BR = mrp_relative(body->sigma_BN, sigma_RN);
    error.omega_RN_B = mat_vec(dcm_BN, reference->omega_RN_N);
    error.omega_BR_B = vec_sub(body->omega_BN_B, error.omega_RN_B);
    error.domega_RN_B = mat_vec(dcm_BN, reference->domega_RN_N);
    int lost = data_lost(t, data_time(body->head, t.t), m->par.hold);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (quality != QUALITY_NONE && !lost && vec_finite(error.sigma_BR) && vec_finite(error.omega_BR_B) &&
        vec_finite(error.omega_RN_B) && vec_finite(error.domega_RN_B)) {
        error.head = head_next(out->head, t.t, quality);
        *out = error;
    } else {
        out->head = head_held(out->head);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_INERTIAL_POINTING_H
#define FLIGHT_GUIDANCE_INERTIAL_POINTING_H

#include "flight/msg/attitude.h"

/** Point at a reference that rests in N: omega_RN_N = domega_RN_N = 0.
 *  Source: thesis, appendix A. */
typedef struct InertialPointing {
    struct {
        AttReference reference;
    } out;
    struct {
        Vec3 sigma_RN; ///< [-] attitude of R relative to N, of either set
    } par;
} InertialPointing;

void inertial_pointing_reset(InertialPointing *m);
void inertial_pointing_update(InertialPointing *m, Tick t);

#endif

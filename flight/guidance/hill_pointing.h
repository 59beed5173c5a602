/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_HILL_POINTING_H
#define FLIGHT_GUIDANCE_HILL_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"

/** Point at the Hill frame: r1 radially outward, r3 along the orbit's angular momentum.
 *  With r, v relative to the planet and h = r x v,
 *     [RN] has the rows r1 = r / |r|, r2 = r3 x r1, r3 = h / |h|
 *     omega_RN_N = h / r^2,   domega_RN_N = -2 (r . v) / r^2 omega_RN_N
 *  Rates and accelerations assume Keplerian motion about the planet.
 *  On a radial trajectory (r and v within 1e-12 of parallel) and at the planet's centre the frame
 *  is undefined: the last good reference is held, degraded.
 *  Source: thesis, appendix A. */
typedef struct HillPointing {
    struct {
        NavOrbit orbit;
        BodyState planet; ///< optional: without it the planet rests at the origin of N
    } in;
    struct {
        AttReference reference;
    } out;
} HillPointing;

void hill_pointing_reset(HillPointing *m);
void hill_pointing_update(HillPointing *m, Tick t);

#endif

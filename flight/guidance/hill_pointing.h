/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_HILL_POINTING_H
#define FLIGHT_GUIDANCE_HILL_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"

/** Point at the Hill frame: r1 radially outward, r3 along the orbit's angular momentum.
 *  Rates and accelerations assume Keplerian motion about the planet.
 *  On a radial trajectory (r and v within 1e-12 of parallel) and at the planet's centre the frame
 *  is undefined: the last good reference is held, degraded.
 *  Source: thesis Eqs. (A.6) to (A.11). */
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

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_VELOCITY_POINTING_H
#define FLIGHT_GUIDANCE_VELOCITY_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"

/** Point at the velocity frame: r2 along the velocity, r3 along the orbit's angular momentum.
 *  r1 lies in the plane of the orbit, outward.
 *  Rates and accelerations assume Keplerian motion about the planet, on any conic.
 *  On a radial trajectory (r and v within 1e-12 of parallel), at rest and at the planet's centre
 *  the frame is undefined: the last good reference is held, degraded.
 *  Source: thesis Eqs. (A.6) to (A.9), (A.12) to (A.17). */
typedef struct VelocityPointing {
    struct {
        NavOrbit orbit;
        BodyState planet; ///< optional: without it the planet rests at the origin of N
    } in;
    struct {
        AttReference reference;
    } out;
    struct {
        double mu; ///< [m^3/s^2] required, > 0: gravitational parameter of the planet
    } par;
} VelocityPointing;

void velocity_pointing_reset(VelocityPointing *m);
void velocity_pointing_update(VelocityPointing *m, Tick t);

#endif

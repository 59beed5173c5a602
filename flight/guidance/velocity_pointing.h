/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_VELOCITY_POINTING_H
#define FLIGHT_GUIDANCE_VELOCITY_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"

/** Point at the velocity frame: r2 along the velocity, r3 along the orbit's angular momentum.
 *  r1 lies in the plane of the orbit, outward. With r, v relative to the planet and h = r x v,
 *     [RN] has the rows r1 = r2 x r3, r2 = v / |v|, r3 = h / |h|
 *     omega_RN_N = mu / (|r|^3 v^2) h,   domega_RN_N = (2 mu / (|r| v^2) - 3) (r . v) / r^2 omega_RN_N
 *  Rates and accelerations assume Keplerian motion about the planet, dv = -mu r / |r|^3, on any conic.
 *  On a radial trajectory (r and v within 1e-12 of parallel), at rest and at the planet's centre
 *  the frame is undefined: the last good reference is held, degraded.
 *  Source: thesis, appendix A, where the rates are by elements, of which some are undefined on some conics. */
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

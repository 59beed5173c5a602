/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_TWO_BODY_POINTING_H
#define FLIGHT_GUIDANCE_TWO_BODY_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/guidance.h"
#include "flight/msg/orbit.h"

/** Point r1 exactly at a primary body, and r2 as nearly as possible at a secondary one.
 *  r3 is normal to the plane of the spacecraft and the bodies, with the secondary on r2's side. With R1 and R2 from the
 *  spacecraft to the primary and the secondary, and derivatives in N,
 *     [RN] has the rows r1 = R1 / |R1|, r2 = r3 x r1, r3 = R1 x R2 / |R1 x R2|
 *     omega_RN_N = (r1 x dr1 + r2 x dr2 + r3 x dr3) / 2,   domega_RN_N = (r1 x ddr1 + r2 x ddr2 + r3 x ddr3) / 2
 *  Where the bodies are collinear, or there is no secondary, r1 still points at the primary, with
 *  its exact rate and acceleration, and R does not turn about r1: r2 is transported parallel along the path of r1 from
 *  its last direction (at first, the axis of N farthest from r1), with an error of order 4 in the time between
 *  updates. The reference is then degraded, and the status holds the reason. The reference jumps where the secondary
 *  can be used again.
 *  The accelerations in the messages enter domega_RN_N only. An acceleration a that a message leaves
 *  at zero causes an error of about a / distance of the body for the direction of r1, and of this
 *  over the sine of the separation for the turn about r1.
 *  Source: thesis, chapter 2; dri = omega x ri of each axis. */
typedef struct TwoBodyPointing {
    struct {
        NavOrbit orbit;
        BodyState primary;
        BodyState secondary; ///< optional, distinct primary: without it only the primary is pointed at, degraded
    } in;
    struct {
        AttReference reference;
        TwoBodyStatus status;
    } out;
    struct {
        double separation_min; ///< [rad] required, in [1e-6, 1.5]: below this angle between the
                               ///< bodies' directions, or its complement to pi, they are collinear
    } par;
    struct {
        Vec3 r1_N;  ///< [-]     r1 of the last reference; 0 until there was one
        Vec3 dr1_N; ///< [rad/s] its derivative in N
        Vec3 r2_N;  ///< [-]     r2 of the last reference
    } mem;
} TwoBodyPointing;

void two_body_pointing_reset(TwoBodyPointing *m);
void two_body_pointing_update(TwoBodyPointing *m, Tick t);

#endif

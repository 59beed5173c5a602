/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_EULER_ROTATION_H
#define FLIGHT_GUIDANCE_EULER_ROTATION_H

#include "flight/msg/attitude.h"
#include "flight/msg/guidance.h"

/** Turn a base reference R0 by 3-2-1 Euler angles that change at constant rates.
 *  With w = omega_RR0 and w', its derivative in R,
 *     (psi, theta, phi) = angles + rates (t - start),   [RN] = [M1(phi)] [M2(theta)] [M3(psi)] [R0N]
 *     w = (dphi, 0, 0) + dtheta (0, cos(phi), -sin(phi)) + dpsi (-sin(theta), sin(phi) cos(theta), cos(phi) cos(theta))
 *     omega_RN = omega_R0N + w,   domega_RN = domega_R0N + w' + omega_R0N x w
 *  The angles count from the first update after a reset, so the first reference is exact.
 *  A command replaces the parameters exactly at its start, because its angles count from there. It
 *  stays in effect until the next command starts.
 *  Modules may be chained; three of them make any of the twelve Euler sequences.
 *  Source: thesis, chapter 2. */
typedef struct EulerRotation {
    struct {
        AttReference base;
        EulerCommand command; ///< optional: replaces the parameters when it starts
    } in;
    struct {
        AttReference reference;
        EulerAngles euler; ///< the angles of the reference relative to the base
    } out;
    struct {
        Vec3 angles; ///< [rad]   psi, theta, phi of R relative to R0 at the start
        Vec3 rates;  ///< [rad/s] their constant rates
    } par;
    struct {
        EulerCommand commanded; ///< the command in effect, if any was
        int64_t start;          ///< [ns] when the angles of the parameters began to count
        int32_t running;        ///< [-]  0 until the first update after a reset
        int32_t spare;
    } mem;
} EulerRotation;

void euler_rotation_reset(EulerRotation *m);
void euler_rotation_update(EulerRotation *m, Tick t);

#endif

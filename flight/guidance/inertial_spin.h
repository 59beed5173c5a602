/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_INERTIAL_SPIN_H
#define FLIGHT_GUIDANCE_INERTIAL_SPIN_H

#include "flight/msg/attitude.h"

/** Spin at a constant rate about an axis fixed in a base reference R0.
 *  The axis is then fixed in R too, with the same components. Over a base that rests in N, the rate
 *  is constant in N. With w = omega_RR0_R0, e = w / |w| and Phi = |w| (t - start),
 *     q_RR0 = (cos(Phi / 2), e sin(Phi / 2)),   [RN] = [RR0] [R0N]
 *     omega_RN = omega_R0N + w,   domega_RN = domega_R0N + omega_R0N x w
 *  The angle counts from the first update after a reset, where R is R0, and is computed anew at
 *  each update, so nothing accumulates. Modules may be chained.
 *  Source: thesis, chapter 2. */
typedef struct InertialSpin {
    struct {
        AttReference base;
    } in;
    struct {
        AttReference reference;
    } out;
    struct {
        Vec3 omega_RR0_R0; ///< [rad/s] angular rate of R relative to R0, R0 components
    } par;
    struct {
        int64_t start;   ///< [ns] when the spin began
        int32_t running; ///< [-]  0 until the first update after a reset
        int32_t spare;
    } mem;
} InertialSpin;

void inertial_spin_reset(InertialSpin *m);
void inertial_spin_update(InertialSpin *m, Tick t);

#endif

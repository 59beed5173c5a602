/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_SLOSH_PENDULUM_H
#define WORLD_DYNAMICS_SLOSH_PENDULUM_H

#include "world/msg/slosh.h"

/** Fuel that sloshes, as spherical pendulums: each is a particle at a constant distance from a pivot that is fixed in
 *  the body, a part of a spacecraft. Thrust is what gives it weight; without it, it drifts.
 *  Assumptions: a massless rod; damping in proportion to the particle's speed in the body.
 *  Source: Dodge 2000; derived in docs/dynamics.md. */
typedef struct SloshPendulum {
    struct {
        SloshState fuel;
    } out;
    struct {
        uint32_t n; ///< [-] in [1, 8]: number of pendulums
        uint32_t spare;
        double mass[SLOSH_MAX];   ///< [kg]    required, count n, in [1e-6, 1e6]: mass, which the craft's leaves out
        double length[SLOSH_MAX]; ///< [m]     required, count n, in [1e-6, 1e3]: of the rod
        Vec3 r_B[SLOSH_MAX];      ///< [m]     required, count n, in [-1e3, 1e3]: pivot
        Vec3 rod_B[SLOSH_MAX];  ///< [-]     required, initial, count n, non-zero: direction from the pivot at the start
        Vec3 spin_B[SLOSH_MAX]; ///< [rad/s] count n, initial: rate of the rod in the body; along the rod: no effect
        double damping[SLOSH_MAX]; ///< [N s/m] count n, >= 0: force per speed
    } par;
} SloshPendulum;

#endif

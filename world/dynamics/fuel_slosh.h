/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_FUEL_SLOSH_H
#define WORLD_DYNAMICS_FUEL_SLOSH_H

#include "world/msg/slosh.h"

/** Fuel that sloshes, as masses on springs: each is a particle that moves along a line fixed in the body, a part of a
 *  spacecraft. Several lines through a tank stand for several directions and modes.
 *  Assumptions: the tank's walls do not stop a particle; the spring and the damper are linear.
 *  Source: Dodge 2000; derived in docs/dynamics.md. */
typedef struct FuelSlosh {
    struct {
        SloshState fuel;
    } out;
    struct {
        uint32_t n; ///< [-] in [1, 8]: number of particles
        uint32_t spare;
        double mass[SLOSH_MAX];      ///< [kg]    required, count n, in [1e-6, 1e6]: mass, which the craft's leaves out
        Vec3 r_B[SLOSH_MAX];         ///< [m]     required, count n, in [-1e3, 1e3]: where the spring is at rest
        Vec3 axes_B[SLOSH_MAX];      ///< [-]     required, count n, non-zero: direction of the line
        double stiffness[SLOSH_MAX]; ///< [N/m]   count n, >= 0: of the spring
        double damping[SLOSH_MAX];   ///< [N s/m] count n, >= 0: force per speed
        double rho[SLOSH_MAX];       ///< [m]     count n, in [-1e3, 1e3], initial: displacement along the line
        double drho[SLOSH_MAX];      ///< [m/s]   count n, initial: its rate
    } par;
} FuelSlosh;

#endif

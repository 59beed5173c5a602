/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_SPACECRAFT_H
#define WORLD_DYNAMICS_SPACECRAFT_H

#include "world/msg/craft.h"

/** A rigid spacecraft: translation about any number of gravity bodies, rotation, and its parts.
 *  Assumptions: constant mass and inertia; the parts' centre of mass does not move; gravity acts on
 *  the centre of mass (no gravity-gradient torque). I_B is the inertia of the vehicle
 *  with its wheels, less the wheels' inertia about their spin axes, as in VehicleData.
 *  A run ends where the spacecraft comes inside a body that attracts it (docs/environment.md).
 *  Source: thesis Eq. (A.1). */
typedef struct Spacecraft {
    struct {
        ForceTorque external; ///< optional: what else acts on it
    } in;
    struct {
        CraftState state;
    } out;
    struct {
        double mass;     ///< [kg]     >= 0: mass; needed where forces act; 0: forces are refused
        Mat3 I_B;        ///< [kg m^2] required, inertia: inertia about the centre of mass
        Vec3 r_BN_N;     ///< [m]      initial: position relative to the origin of N
        Vec3 v_BN_N;     ///< [m/s]    initial: velocity
        Vec3 sigma_BN;   ///< [-]      initial: attitude
        Vec3 omega_BN_B; ///< [rad/s]  initial: angular rate, B components
    } par;
} Spacecraft;

#endif

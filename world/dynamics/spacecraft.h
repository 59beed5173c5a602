/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_SPACECRAFT_H
#define WORLD_DYNAMICS_SPACECRAFT_H

#include "world/msg/craft.h"

/** A rigid body, the hub, with its parts: translation about any number of gravity bodies, and rotation.
 *     dr = v,   dv = gravity + force / mass
 *     dsigma = ((1 - sigma . sigma) omega + 2 sigma x omega + 2 (sigma . omega) sigma) / 4
 *     I_B domega = -omega x (I_B omega + sum of the parts' momenta) + sum of the parts' torques + torque
 *  with r and v of the centre of mass of all, sigma_BN and omega_BN_B. Coupled parts add their degrees of freedom.
 *  Assumptions: gravity acts on the centre of mass of all (a part may add its gradient). mass, center_B and
 *  I_B are those of the hub with its wheels, less the wheels' inertia about their spin axes, as in VehicleData;
 *  coupled parts (panels, tanks, sloshing fuel) bring their own masses (docs/dynamics.md).
 *  A run ends where the spacecraft comes inside a body that attracts it (docs/environment.md).
 *  Source: thesis, appendix A; Schaub and Junkins, chapters 3 and 4. */
typedef struct Spacecraft {
    struct {
        ForceTorque external; ///< optional: what else acts on it; each further output has a part ExternalForce
    } in;
    struct {
        CraftState state;
    } out;
    struct {
        double mass;     ///< [kg]     >= 0: mass; needed where forces act; 0: forces are refused
        Vec3 center_B;   ///< [m]      initial, in [-1e3, 1e3]: centre of mass of the hub, relative to the body's origin
        Mat3 I_B;        ///< [kg m^2] required, inertia: inertia about the hub's centre of mass
        Vec3 r_BN_N;     ///< [m]      initial: position of the body's origin relative to the origin of N
        Vec3 v_BN_N;     ///< [m/s]    initial: velocity
        Vec3 sigma_BN;   ///< [-]      initial: attitude
        Vec3 omega_BN_B; ///< [rad/s]  initial: angular rate, B components
    } par;
} Spacecraft;

#endif

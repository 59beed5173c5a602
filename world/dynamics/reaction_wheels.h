/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_REACTION_WHEELS_H
#define WORLD_DYNAMICS_REACTION_WHEELS_H

#include "flight/msg/wheels.h"

/** Balanced reaction wheels, a part of a spacecraft.
 *  Assumptions: no imbalance; the motor gives the commanded torque at once, up to its limit;
 *  Coulomb friction holds a wheel at rest until the motor overcomes it. Friction and speed limit
 *  act by whole updates, so the task's period bounds how sharply a wheel stops.
 *  Source: thesis Eqs. (A.1) to (A.3). */
typedef struct ReactionWheels {
    struct {
        WheelCommand command; ///< optional: motor torques; without it the motors are off
    } in;
    struct {
        WheelSpeeds speeds;
        WheelCommand applied; ///< motor torques after the limits
    } out;
    struct {
        uint32_t n; ///< [-] in [1, 8]: number of wheels
        uint32_t spare;
        Vec3 axes_B[WHEELS_MAX];      ///< [-]      required, count n, non-zero: spin axes
        double J[WHEELS_MAX];         ///< [kg m^2] required, count n, > 0: inertia about the axis
        double u_max[WHEELS_MAX];     ///< [N m]    count n, >= 0: largest torque; 0: unlimited
        double Omega_max[WHEELS_MAX]; ///< [rad/s]  count n, >= 0, assumed: speed limit; 0: none
        double friction[WHEELS_MAX];  ///< [N m]    count n, >= 0, assumed: Coulomb friction
        double viscosity[WHEELS_MAX]; ///< [N m s]  count n, >= 0: viscous friction per rad/s
        double Omega[WHEELS_MAX];     ///< [rad/s]  count n, initial: speeds
    } par;
    struct {
        uint64_t saturated; ///< [-] updates in which a limit reduced a motor's torque
    } mem;
} ReactionWheels;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_REACTION_WHEELS_H
#define WORLD_DYNAMICS_REACTION_WHEELS_H

#include "flight/msg/wheels.h"
#include "world/msg/fault.h"

/** Reaction wheels, a part of a spacecraft. With an imbalance they shake it: as masses that move, exactly, or
 *  (`jitter`), at less cost, as the forces and torques of wheels in a body that stands still.
 *  Balanced, with g of axes_B,
 *     h = J (g . omega_BN + Omega),   dh = u + friction - viscosity Omega,   torque on the body: -dh g
 *  Assumptions: the motor gives the commanded torque at once, up to its limit;
 *  Coulomb friction holds a wheel at rest until the motor overcomes it. Friction and speed limit
 *  act by whole updates, so the task's period bounds how sharply a wheel stops. A motor drives its wheel to the limit
 *  exactly, and then gives what holds it there; it does not brake one that the body's motion carries further.
 *  The static imbalance of a wheel with the axis g points along u cos theta + g x u sin theta, with u along g x b1, b1
 *  the body's first axis; where |g . b1| is 0.6 or more, along g x b2.
 *  The channels of its faults: 0 to 7 the torques of the motors, 8 to 15 the measured speeds.
 *  Source: thesis, appendix A; imbalances and their frames: docs/dynamics.md. */
typedef struct ReactionWheels {
    struct {
        WheelCommand command; ///< optional: motor torques; without it the motors are off
        FaultSet injected;    ///< optional: faults, besides the planned ones
    } in;
    struct {
        WheelSpeeds speeds;
        WheelCommand applied; ///< motor torques after the limits
    } out;
    struct {
        uint32_t n;                   ///< [-] in [1, 8]: number of wheels
        uint32_t n_faults;            ///< [-] in [0, 4]: number of planned faults
        Vec3 axes_B[WHEELS_MAX];      ///< [-]      required, count n, non-zero: spin axes
        double J[WHEELS_MAX];         ///< [kg m^2] required, count n, > 0: inertia about the axis
        double u_max[WHEELS_MAX];     ///< [N m]    count n, >= 0: largest torque; 0: unlimited
        double Omega_max[WHEELS_MAX]; ///< [rad/s]  count n, >= 0, assumed: speed limit; 0: none
        double friction[WHEELS_MAX];  ///< [N m]    count n, >= 0, assumed: Coulomb friction
        double viscosity[WHEELS_MAX]; ///< [N m s]  count n, >= 0: viscous friction per rad/s
        double Omega[WHEELS_MAX];     ///< [rad/s]  count n, initial: speeds
        Fault faults[FAULTS_MAX];     ///< count n_faults: planned
        double stiction[WHEELS_MAX];  ///< [N m]    count n, >= 0: friction at rest; counts if it exceeds `friction`
        double stribeck[WHEELS_MAX];  ///< [rad/s]  count n, >= 0: speed at which 1/e of that excess is left (Stribeck)
        double unbalance[WHEELS_MAX]; ///< [kg m]   count n, in [0, 1e3], initial: static imbalance
        double couple[WHEELS_MAX];    ///< [kg m^2] count n, in [0, 1e3], initial: dynamic imbalance
        Vec3 r_WB_B[WHEELS_MAX];      ///< [m]      count n, in [-1e3, 1e3], initial: centres; they count if imbalanced
        double theta[WHEELS_MAX];     ///< [rad]    count n, in [-1e6, 1e6], initial: angles of their imbalances
        uint32_t jitter;              ///< [-]      in [0, 1], initial: 1: an imbalance acts as added force and torque
        uint32_t spare_2;
    } par;
    struct {
        uint64_t saturated; ///< [-] updates in which a limit reduced a motor's torque
    } mem;
} ReactionWheels;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_NAVIGATION_H
#define WORLD_SENSORS_NAVIGATION_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"
#include "world/msg/craft.h"
#include "world/msg/fault.h"

/** The navigation solution: the truth, with constant bias and seeded white noise where given.
 *  Attitude errors are rotations about the body axes. The acceleration is the true one.
 *  The channels of its faults: 0 to 2 attitude (a bias or drift is a turn about a body axis, all else acts on the MRP),
 *  3 to 5 rate, 6 to 8 position, 9 to 11 velocity.
 *  Assumptions: no delay; noise is drawn anew at each update, independent between axes. */
typedef struct Navigation {
    struct {
        CraftState truth;
        FaultSet injected; ///< optional: faults, besides the planned ones
    } in;
    struct {
        NavAttitude attitude;
        NavOrbit orbit;
    } out;
    struct {
        Vec3 attitude_noise; ///< [rad]   >= 0, assumed: standard deviation about each body axis
        Vec3 rate_noise;     ///< [rad/s] >= 0: standard deviation of each axis
        Vec3 position_noise; ///< [m]     >= 0: standard deviation of each axis
        Vec3 velocity_noise; ///< [m/s]   >= 0: standard deviation of each axis
        Vec3 attitude_bias;  ///< [rad]   constant rotation about each body axis
        Vec3 rate_bias;      ///< [rad/s] constant error
        Vec3 position_bias;  ///< [m]     constant error
        Vec3 velocity_bias;  ///< [m/s]   constant error
        uint32_t n_faults;   ///< [-] in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
} Navigation;

#endif

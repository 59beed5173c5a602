/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_NAVIGATION_H
#define WORLD_SENSORS_NAVIGATION_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"
#include "world/msg/craft.h"

/** The navigation solution: the truth, with constant bias and seeded white noise where given.
 *  Attitude errors are rotations about the body axes. The acceleration is the true one.
 *  Assumptions: no delay; noise is drawn anew at each update, independent between axes. */
typedef struct Navigation {
    struct {
        CraftState truth;
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
    } par;
} Navigation;

#endif

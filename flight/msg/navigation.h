/* SPDX-License-Identifier: Apache-2.0 */
/* What filters of the navigation report of themselves. */
#ifndef FLIGHT_MSG_NAVIGATION_H
#define FLIGHT_MSG_NAVIGATION_H

#include "flight/math/vec.h"
#include "flight/msg/avionics.h"

/** How an attitude filter stands. */
typedef struct AttitudeFilterState {
    Head head;
    Vec3 bias_B;       ///< [rad/s] bias of the gyro, B components
    Vec3 attitude_std; ///< [rad]   standard deviations of the attitude's error about the axes of B
    Vec3 bias_std;     ///< [rad/s] standard deviations of the bias' error
    double misfit;     ///< [-]     of the last measured attitude: its normalised innovation squared, on average 3
    uint32_t used;     ///< [-]     measured attitudes that were used
    uint32_t rejected; ///< [-]     measured attitudes that did not fit
    uint32_t late;     ///< [-]     measured attitudes of a time that the filter can no longer use
    uint32_t restarts; ///< [-]     how often the filter began anew
} AttitudeFilterState;

/** What coarse sun sensors see: the first n entries count. */
typedef struct SunCosines {
    Head head;
    uint32_t n;                     ///< [-] in [0, 8]: number of sensors
    uint32_t lit;                   ///< [-] those that see the Sun, a bit for each
    double cosine[SUN_SENSORS_MAX]; ///< [-] count n: of the angle between their axes and the Sun
    double weight[SUN_SENSORS_MAX]; ///< [-] count n: proportional to the inverse of their errors' variance
    Vec3 axes_B[SUN_SENSORS_MAX];   ///< [-] count n: where they look, unit vectors
} SunCosines;

/** How the filter of the direction to the Sun stands. */
typedef struct SunLineState {
    Head head;
    double std;        ///< [rad]   standard deviation of the direction's error, both axes together
    double rate_std;   ///< [rad/s] and of the rate's error across the direction
    uint32_t used;     ///< [-]     sensors that the last update used
    uint32_t rejected; ///< [-]     lit sensors whose cosines did not fit, since the reset
    uint32_t restarts; ///< [-]     how often the filter began anew
    uint32_t spare;
} SunLineState;

#endif

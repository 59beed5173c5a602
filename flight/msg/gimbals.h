/* SPDX-License-Identifier: Apache-2.0 */
/* The gimbals of control moment gyros. Their wheels have the messages of wheels.h. */
#ifndef FLIGHT_MSG_GIMBALS_H
#define FLIGHT_MSG_GIMBALS_H

#include "flight/msg/wheels.h"

/** Where the gimbals are. */
typedef struct GimbalState {
    Head head;
    double angle[WHEELS_MAX]; ///< [rad]   about the gimbal's axis, from where the wheel's axis is at the beginning
    double rate[WHEELS_MAX];  ///< [rad/s] relative to the body
} GimbalState;

/** Rates for the gimbals. */
typedef struct GimbalRates {
    Head head;
    double rate[WHEELS_MAX]; ///< [rad/s] relative to the body
} GimbalRates;

/** Motor torques for the gimbals. */
typedef struct GimbalTorques {
    Head head;
    double u[WHEELS_MAX]; ///< [N m] torque of the motor on the gimbal, about its axis
} GimbalTorques;

#endif

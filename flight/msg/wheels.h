/* SPDX-License-Identifier: Apache-2.0 */
/* Reaction wheels: their set, speeds, availability and commands. */
#ifndef FLIGHT_MSG_WHEELS_H
#define FLIGHT_MSG_WHEELS_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

#define WHEELS_MAX 8

/** The wheels of the vehicle: the first n entries count. */
typedef struct WheelSet {
    Head head;
    uint32_t n; ///< [-] in [0, 8]: number of wheels
    uint32_t spare;
    Vec3 axes_B[WHEELS_MAX];  ///< [-]      count n: unit spin axes
    double J[WHEELS_MAX];     ///< [kg m^2] count n: inertia about the spin axis
    double u_max[WHEELS_MAX]; ///< [N m]    count n: largest motor torque; 0: unlimited
} WheelSet;

/** The number of wheels, also where a message holds more than there is room for. */
static inline uint32_t wheels_count(const WheelSet *wheels)
{
    return wheels->n < WHEELS_MAX ? wheels->n : WHEELS_MAX;
}

/** The measured speeds of the wheels relative to the body. */
typedef struct WheelSpeeds {
    Head head;
    double Omega[WHEELS_MAX]; ///< [rad/s] spin rate relative to the body
} WheelSpeeds;

/** Which wheels may be used now. */
typedef struct WheelAvailability {
    Head head;
    uint8_t available[WHEELS_MAX]; ///< [-] in [0, 1]: 1 if the wheel may be used
} WheelAvailability;

/** Motor torques for the wheels. */
typedef struct WheelCommand {
    Head head;
    double u[WHEELS_MAX]; ///< [N m] torque of the motor on the wheel, about its spin axis
} WheelCommand;

#endif

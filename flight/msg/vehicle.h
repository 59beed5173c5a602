/* SPDX-License-Identifier: Apache-2.0 */
/* The vehicle, and torques on it. */
#ifndef FLIGHT_MSG_VEHICLE_H
#define FLIGHT_MSG_VEHICLE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** What flight software knows of the vehicle. */
typedef struct VehicleData {
    Head head;
    Mat3 I_B; ///< [kg m^2] inertia about the centre of mass, wheels included but for their spin
} VehicleData;

/** A torque on the body. */
typedef struct BodyTorque {
    Head head;
    Vec3 torque_B; ///< [N m] torque about the centre of mass, B components
} BodyTorque;

#endif

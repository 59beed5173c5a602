/* SPDX-License-Identifier: Apache-2.0 */
/* The vehicle, and torques on it. */
#ifndef FLIGHT_MSG_VEHICLE_H
#define FLIGHT_MSG_VEHICLE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** What flight software knows of the vehicle.
 *  The inertia is [I] of thesis Eq. (A.1): that of the vehicle with its wheels, less J g g^T of each
 *  wheel about its spin axis g, for there the wheel's momentum J (g . omega_BN + Omega) counts. */
typedef struct VehicleData {
    Head head;
    Mat3 I_B; ///< [kg m^2] inertia about the centre of mass, less the wheels' about their spin axes
} VehicleData;

/** A torque on the body. */
typedef struct BodyTorque {
    Head head;
    Vec3 torque_B; ///< [N m] torque about the centre of mass, B components
} BodyTorque;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The vehicle, and torques on it. */
#ifndef FLIGHT_MSG_VEHICLE_H
#define FLIGHT_MSG_VEHICLE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** What flight software knows of the vehicle.
 *  The inertia is that of the vehicle with its wheels, less J g g^T of each wheel about its spin axis g, where the
 *  wheel's momentum J (g . omega_BN + Omega) counts: with motor torques u and a torque L from outside,
 *     I_B domega_BN = -omega_BN x (I_B omega_BN + sum J (g . omega_BN + Omega) g) - sum u g + L */
typedef struct VehicleData {
    Head head;
    Mat3 I_B; ///< [kg m^2] inertia about the centre of mass, less the wheels' about their spin axes
} VehicleData;

/** A torque on the body. */
typedef struct BodyTorque {
    Head head;
    Vec3 torque_B; ///< [N m] torque about the centre of mass, B components
} BodyTorque;

/** Writes, holds or ends a torque, by head_acting(); one that is not finite is none. Returns 1 if it is written. */
static inline int torque_put(BodyTorque *out, Vec3 torque_B, Tick t, Quality quality, int64_t of, double hold,
                             int64_t *newest)
{
    quality = vec_finite(torque_B) ? quality : QUALITY_NONE;
    const int acts = head_acting(&out->head, t, quality, of, hold, newest);
    if (acts >= 0) {
        out->torque_B = acts ? torque_B : vec3(0.0, 0.0, 0.0);
    }
    return acts > 0;
}

#endif

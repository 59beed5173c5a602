/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_CONTROL_RATE_DAMPING_H
#define FLIGHT_CONTROL_RATE_DAMPING_H

#include "flight/msg/sensors.h"
#include "flight/msg/vehicle.h"

/** Bring the body to rest in N from its rate alone:
 *     u = -P omega_BN,   |u| <= torque_max with its direction kept
 *  The energy of the body and of its wheels' turns falls by omega . P omega, whatever the inertia and the wheels'
 *  momentum are, for omega x H does no work; so neither is an input. Wheels take up the momentum that the body had:
 *  they must be able to hold it. Without usable rates the torque is held, degraded; after `hold` it is zero, degraded.
 *  Source: Wie 2008, section 7.3. */
typedef struct RateDamping {
    struct {
        GyroRate gyro;
    } in;
    struct {
        BodyTorque torque; ///< wanted control torque on the body
    } out;
    struct {
        Mat3 P;            ///< [N m s] required: gain on the rate
        double torque_max; ///< [N m] >= 0: largest torque; 0: none
        double hold;       ///< [s] >= 0: how long the torque goes on without new data; 0: ten updates
    } par;
    struct {
        int64_t newest; ///< [ns] the time of the newest rate that was used
    } mem;
} RateDamping;

void rate_damping_reset(RateDamping *m);
void rate_damping_update(RateDamping *m, Tick t);

#endif

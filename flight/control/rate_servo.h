/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_CONTROL_RATE_SERVO_H
#define FLIGHT_CONTROL_RATE_SERVO_H

#include "flight/msg/attitude.h"
#include "flight/msg/rate.h"
#include "flight/msg/vehicle.h"
#include "flight/msg/wheels.h"

/** Track a rate relative to a moving reference: the torque on the body
 *     -(P omega_BD + K_I z) + omega_DN x H + I (domega_DR + domega_RN - omega_BN x omega_RN) - L
 *  with omega_BD = omega_BR - omega_DR, z its integral, and H as in MrpFeedback. The errors then fall: with
 *  V = omega_BD . I omega_BD / 2 + K_I z . z / 2, dV = -omega_BD . P omega_BD.
 *  Missing, old and lost inputs are treated as in MrpFeedback: after `hold` without new data the torque is zero,
 *  degraded; nothing is integrated across an update without usable data.
 *  Source: Schaub and Piggott 2018. */
typedef struct RateServo {
    struct {
        AttError error;
        RateCommand command; ///< the rate that the body shall have relative to the reference
        VehicleData vehicle; ///< inertia, from the vehicle configuration
        WheelSet wheels;     ///< optional: the wheels' axes and inertias
        WheelSpeeds speeds;  ///< optional: without it the wheels' momentum is not compensated
        BodyTorque external; ///< optional: known external torque, to be compensated
    } in;
    struct {
        BodyTorque torque; ///< wanted control torque on the body
    } out;
    struct {
        Mat3 P;         ///< [N m s] required: gain on the rate error
        double K_I;     ///< [N m]   >= 0: gain on the integrated rate error; 0: off
        double u_I_max; ///< [N m]   >= 0: largest integral torque per axis, anti-windup; 0: none
        double hold;    ///< [s]     >= 0: how long the torque goes on without new data; 0: ten updates
    } par;
    struct {
        Vec3 z;          ///< [-]     integral of the rate error
        Vec3 omega_BD_B; ///< [rad/s] the rate error at the last update, if running
        int64_t newest;  ///< [ns]    the time of the newest data that were used
        int32_t running; ///< [-]     1 if the last update since a reset could use its inputs
        int32_t spare;
    } mem;
} RateServo;

void rate_servo_reset(RateServo *m);
void rate_servo_update(RateServo *m, Tick t);

#endif

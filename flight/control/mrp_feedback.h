/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static MrpFeedback m = {.par = {.K = 2.0, .P = {{{10.0, 0.0, 0.0}, {0.0, 10.0, 0.0}, {0.0, 0.0, 10.0}}}}};
 *     mrp_feedback_reset(&m);
 *     m.in.error = (AttError){.head = {0, QUALITY_GOOD, 1}, .sigma_BR = vec3(0.01, 0.0, 0.0)};
 *     m.in.vehicle = (VehicleData){.head = {0, QUALITY_GOOD, 1}, .I_B = mat_identity()};
 *     mrp_feedback_update(&m, (Tick){.t = 0, .dt = 0});
 *     const Vec3 torque_B = m.out.torque.torque_B; // -0.02 N m about the first axis
 */
#ifndef FLIGHT_CONTROL_MRP_FEEDBACK_H
#define FLIGHT_CONTROL_MRP_FEEDBACK_H

#include "flight/msg/attitude.h"
#include "flight/msg/vehicle.h"
#include "flight/msg/wheels.h"

/** Track a moving attitude reference with feedback on the MRP and rate errors.
 *  The torque wanted on the body, in B components, with the wheels' axes g_i:
 *     torque = -K sigma_BR - P omega_BR - K_I z + omega_RN x H + I (domega_RN - omega_BN x omega_RN) - external
 *     H = I omega_BN + sum J_i (g_i . omega_BN + Omega_i) g_i,   omega_BN = omega_BR + omega_RN,   dz = sigma_BR
 *  On a body that moves by I domega_BN = -omega_BN x H + torque + external, it leaves, with the derivative in B,
 *     I domega_BR = -omega_BR x H - K sigma_BR - P omega_BR - K_I z
 *  so that V = omega_BR . I omega_BR / 2 + 2 K log(1 + sigma_BR^2) falls as -omega_BR . P omega_BR while K_I is 0.
 *  Wheels whose speeds are unknown are not compensated, and the torque is degraded.
 *  Nothing is integrated across an update whose error could not be used.
 *  Where no torque can be computed, the last one is held, degraded. After `hold` without new data, which includes an
 *  error that is not good and gets older, the torque is zero, degraded.
 *  Source: thesis, appendix A; Schaub and Junkins, chapter 8. */
typedef struct MrpFeedback {
    struct {
        AttError error;
        VehicleData vehicle; ///< inertia, from the vehicle configuration
        WheelSet wheels;     ///< optional: the wheels' axes and inertias
        WheelSpeeds speeds;  ///< optional: without it the wheels' momentum is not compensated
        BodyTorque external; ///< optional: known external torque, to be compensated
    } in;
    struct {
        BodyTorque torque; ///< wanted control torque on the body
    } out;
    struct {
        double K;       ///< [N m]   required, > 0: gain on the MRP error
        Mat3 P;         ///< [N m s] required: gain on the rate error
        double K_I;     ///< [N m / s] >= 0: gain on the integrated error; 0: off
        double u_I_max; ///< [N m]   >= 0: largest integral torque per axis, anti-windup; 0: none
        double hold;    ///< [s]     >= 0: how long the torque goes on without new data; 0: ten updates
    } par;
    struct {
        Vec3 z;          ///< [s] integral of the MRP error
        Vec3 sigma_BR;   ///< [-] the MRP error at the last update, if running
        int64_t newest;  ///< [ns] the time of the newest error that was used
        int32_t running; ///< [-] 1 if the last update since a reset could use its error
        int32_t spare;
    } mem;
} MrpFeedback;

void mrp_feedback_reset(MrpFeedback *m);
void mrp_feedback_update(MrpFeedback *m, Tick t);

#endif

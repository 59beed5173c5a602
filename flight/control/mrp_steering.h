/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_CONTROL_MRP_STEERING_H
#define FLIGHT_CONTROL_MRP_STEERING_H

#include "flight/msg/attitude.h"
#include "flight/msg/rate.h"

/** Turn the attitude error into the rate at which the body shall reduce it, with a limit on the rate about each axis:
 *     omega_DR = -f(sigma_BR),   f(x) = 2 omega_max / pi  atan(pi / (2 omega_max) (K1 x + K3 x^3))
 *  If the body turns so, V = 2 log(1 + sigma_BR^2) falls as -sigma_BR . f(sigma_BR). A servo tracks the rate
 *  (RateServo). The derivative is that along the measured rate, so that the servo's error decays as if the rate were
 *  constant. Without an error the rate is held, degraded; the servo limits in time how long that counts.
 *  Source: Schaub and Piggott 2018. */
typedef struct MrpSteering {
    struct {
        AttError error;
    } in;
    struct {
        RateCommand command;
    } out;
    struct {
        double K1;        ///< [rad/s] required, > 0, <= 1e6: gain on the MRP error
        double K3;        ///< [rad/s] >= 0, <= 1e6: gain on its cube: faster where the error is large
        double omega_max; ///< [rad/s] required, > 0, <= 1e6: largest rate about an axis
    } par;
} MrpSteering;

void mrp_steering_reset(MrpSteering *m);
void mrp_steering_update(MrpSteering *m, Tick t);

#endif

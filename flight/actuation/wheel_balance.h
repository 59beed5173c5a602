/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_WHEEL_BALANCE_H
#define FLIGHT_ACTUATION_WHEEL_BALANCE_H

#include "flight/msg/wheels.h"

/** Add to motor torques such as move the wheels' speeds towards wanted ones without a torque on the body:
 *     u + N d,   d = -K (Omega - Omega_wanted),   N = I - G^+ G
 *  with the unit axes of the available wheels the columns of G. The sum of J (Omega - Omega_wanted)^2 falls as far as
 *  the null motion of the wheels reaches; with wanted speeds of zero, which is balancing, no other distribution of the
 *  same momentum among equal wheels has a smaller sum. Where a motor would pass its limit, the null motion alone is
 *  scaled. Three wheels or fewer have no null motion.
 *  Without speeds that are new, where wanted ones at the input are old, and where the null motion is not finite, the
 *  command passes unchanged, degraded. The output is as old as the command, which its sender ends (WheelTorques); one
 *  that is not finite is held, degraded.
 *  Source: Schaub and Junkins; the projector of the pseudo-inverse. */
typedef struct WheelBalance {
    struct {
        WheelCommand torques;
        WheelSet wheels;
        WheelSpeeds speeds;
        WheelAvailability availability; ///< optional: without it all wheels may be used
        WheelSpeeds wanted;             ///< optional: without it the speeds of the parameter are wanted
    } in;
    struct {
        WheelCommand command;
    } out;
    struct {
        double K;                 ///< [N m s] required, > 0: gain on the error of a speed
        double Omega[WHEELS_MAX]; ///< [rad/s] wanted speeds
        double hold;              ///< [s] >= 0: how long old speeds and old wanted ones count; 0: ten updates
    } par;
} WheelBalance;

void wheel_balance_reset(WheelBalance *m);
void wheel_balance_update(WheelBalance *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_WHEEL_SPEED_PLAN_H
#define FLIGHT_ACTUATION_WHEEL_SPEED_PLAN_H

#include "flight/msg/wheel_plan.h"

/** Wanted speeds for WheelBalance that keep wheels away from zero, where they stick, and from their largest speed.
 *  With unit axes g_i, the available wheels may turn at all speeds that have the momentum of now. The plan is for
 *      Omega(s) = Omega_0 + s d,   sum J_i d_i g_i = 0,
 *  with Omega_0 of the least energy and d the null motion that moves the slowest wheel most for signs +-1 of all
 *  wheels; of four wheels there is no other. Among all s it takes, in this order, that with the least speed above
 *  Omega_max; the fewest wheels in the band |Omega| < Omega_min; the directions of turning of the last plan; the least
 *  depth of a wheel in the wider band, Omega_min + margin; the least |s|, which is the least energy.
 *  So wheels change direction only where they must, with `margin` as the hysteresis, and a change is a step of the
 *  wanted speeds, on which WheelBalance takes them through zero in about J / K log(1 + 2 Omega_min / margin).
 *  The torque of that is none on the body, as long as the motors give it.
 *  Three wheels or fewer, if they are independent, have no null motion: their own speeds are wanted, the phase is
 *  WHEEL_PLAN_NONE. A wheel that the null motion does not reach keeps its speed; of one
 *  that may not be used, none is wanted.
 *  The plan is as good as its inputs; where it is not finite, the last one is held, degraded.
 *  Source: the null space of Schaub and Junkins, section 8.8; all points at which the order can change are tried. */
typedef struct WheelSpeedPlan {
    struct {
        WheelSet wheels;
        WheelSpeeds speeds;
        WheelAvailability availability; ///< optional: without it all wheels may be used
    } in;
    struct {
        WheelSpeeds wanted; ///< for WheelBalance
        WheelPlanState state;
    } out;
    struct {
        double Omega_min; ///< [rad/s] required, > 0: no wheel shall stay slower
        double Omega_max; ///< [rad/s] required, > 0: no wheel shall be faster
        double margin;    ///< [rad/s] required, > 0: by which the plan stays away from Omega_min, where it can
    } par;
    struct {
        uint32_t running;   ///< [-] 0 until the first plan after a reset
        uint32_t backwards; ///< [-] wheels that the last plan turns backwards, a bit for each
    } mem;
} WheelSpeedPlan;

void wheel_speed_plan_reset(WheelSpeedPlan *m);
void wheel_speed_plan_update(WheelSpeedPlan *m, Tick t);

#endif

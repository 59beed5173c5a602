/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_DELTA_V_ACCUMULATION_H
#define FLIGHT_GUIDANCE_DELTA_V_ACCUMULATION_H

#include "flight/msg/attitude.h"
#include "flight/msg/burn.h"
#include "flight/msg/sensors.h"

/** Add up what accelerometers measure to the velocity that thrust has added, in N:
 *     dv_N = int [NB] (f_B - bias_B) dt,   path = int |f_B - bias_B| dt
 *  by the trapezoid between the instants of two measurements that are not older than the last; a gap is bridged in the
 *  same way when it ends. The sum never starts anew but by a reset; a burn takes differences. Without a measurement or
 *  an attitude it is held, degraded, and its time says since when.
 *  Source: the definition of velocity; the trapezoidal rule. */
typedef struct DeltaVAccumulation {
    struct {
        SpecificForce force;
        NavAttitude attitude;
    } in;
    struct {
        DeltaVSum sum;
    } out;
    struct {
        Vec3 bias_B; ///< [m/s^2] of the accelerometers, as far as it is known
    } par;
} DeltaVAccumulation;

void delta_v_accumulation_reset(DeltaVAccumulation *m);
void delta_v_accumulation_update(DeltaVAccumulation *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_DELTA_V_ACCUMULATION_H
#define FLIGHT_GUIDANCE_DELTA_V_ACCUMULATION_H

#include "flight/msg/attitude.h"
#include "flight/msg/burn.h"
#include "flight/msg/sensors.h"

/** Add up what accelerometers measure to the velocity that thrust has added, in N:
 *     dv_N = int [NB] (f_B - bias_B) dt,   path = int |f_B - bias_B| dt
 *  by what they have counted between two measurements, the later of which is not older than the last, by the mean of
 *  [NB] then; so nothing is lost in an update that is late, or between two slow ones. The sum never starts anew but
 *  by a reset; a burn takes differences. Without a measurement or an attitude it is held, degraded, and its time says
 *  since when.
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
    struct {
        Vec3 dv_B;     ///< [m/s] what they had counted at the last measurement
        Vec3 sigma_BN; ///< [-] attitude then
    } mem;
} DeltaVAccumulation;

void delta_v_accumulation_reset(DeltaVAccumulation *m);
void delta_v_accumulation_update(DeltaVAccumulation *m, Tick t);

#endif

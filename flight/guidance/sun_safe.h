/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_SUN_SAFE_H
#define FLIGHT_GUIDANCE_SUN_SAFE_H

#include "flight/msg/attitude.h"
#include "flight/msg/sensors.h"
#include "flight/msg/sun.h"

/** Turn a body axis to the Sun by the direction of the Sun and the rate alone, and spin about it; no attitude is
 *  needed. With c the axis and s the direction to the Sun, at an angle Phi from each other,
 *     sigma_BR = tan(Phi / 4) s x c / |s x c|,   omega_RN = spin s
 *  Where the two are opposite, the turn is about an axis across c. Without a direction, and `hold` after the last one,
 *  the body searches: R then turns at the rate `search_B` in the body, and the attitude error is zero; degraded.
 *  Without a rate the error is held, degraded; the control that uses it ends the torque.
 *  Source: Schaub and Junkins, section 3.4, for the turn by an axis and an angle. */
typedef struct SunSafe {
    struct {
        SunHeading sun;
        GyroRate rate;
    } in;
    struct {
        AttError error;
    } out;
    struct {
        Vec3 axis_B;   ///< [-] required, non-zero: what shall point to the Sun
        double spin;   ///< [rad/s] about the direction to the Sun
        Vec3 search_B; ///< [rad/s] rate of the search where no Sun is seen
        double hold;   ///< [s] >= 0: how long an old direction counts; 0: ten updates
    } par;
    struct {
        uint64_t searched; ///< [-] updates without a direction
    } mem;
} SunSafe;

void sun_safe_reset(SunSafe *m);
void sun_safe_update(SunSafe *m, Tick t);

#endif

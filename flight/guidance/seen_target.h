/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_SEEN_TARGET_H
#define FLIGHT_GUIDANCE_SEEN_TARGET_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"
#include "flight/msg/sensors.h"

/** Where another spacecraft T is and points, by a sensor that sees it and by the navigation of this one: what
 *  BaseReference takes as the sensed attitude, and TwoBodyPointing as a body.
 *     sigma_TN = that of [TB][BN],   omega_TN_T = [TB] (omega_BN_B + omega_TB_B)
 *     r_TN = r_BN + [NB] (r_TB + age v_TB),   v_TN = v_BN + [NB] v_TB
 *  The sensor says what it holds of an earlier time: the body's attitude is carried back to that time by its rate, and
 *  what the sensor sees is carried to now, but for the attitude of T, whose head has the time of the measurement.
 *  A sight older than `hold`, or of a time to come, does not count: the outputs are held, degraded.
 *  Source: Schaub and Junkins, sections 1.3 (frames that turn) and 3.5. */
typedef struct SeenTarget {
    struct {
        SeenCraft seen;
        NavAttitude own;
        NavOrbit orbit; ///< optional: without it the state of T is not computed
    } in;
    struct {
        NavAttitude attitude; ///< of T relative to N
        BodyState body;       ///< of T
    } out;
    struct {
        double hold; ///< [s] required, > 0, <= 1000: how old a sight may be
    } par;
} SeenTarget;

void seen_target_reset(SeenTarget *m);
void seen_target_update(SeenTarget *m, Tick t);

#endif

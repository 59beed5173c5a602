/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ATTITUDE_MEKF_H
#define FLIGHT_NAVIGATION_ATTITUDE_MEKF_H

#include "flight/navigation/attitude_filter.h"

/** The attitude from star tracker and gyro by a multiplicative extended Kalman filter in square-root form: it
 *  estimates the small turn theta from its attitude to the true one, four times the MRP between them, and the gyro's
 *  bias. A measured attitude counts at the time in its head, if that is at most 16 rates old; one of a time to come
 *  waits for it. A degraded one counts, but the output is degraded wherever the last measured attitude did not count
 *  or was not good. One whose normalised innovation exceeds the gate is rejected and counted; if as many as
 *  `persistence` in a row are rejected and agree with each other by the gyro's rates, the filter begins anew with the
 *  last: so it leaves a wrong first attitude, and a stuck star tracker, which repeats an attitude to the last digit,
 *  does not draw it away. The output is degraded until `persistence` attitudes count, the first among them. A gap of
 *  the gyro up to `hold` is bridged; after a longer one the output is held, degraded, and the filter begins anew. The
 *  estimate of the bias outlives that.
 *  Sources: Markley 2003; Lefferts, Markley and Shuster 1982; attitude_filter.h has the equations. */
typedef struct AttitudeMekf {
    struct {
        GyroRate gyro;
        StarAttitude stars;
    } in;
    struct {
        NavAttitude attitude;
        AttitudeFilterState state;
    } out;
    AttitudeFilterParameters par;
    struct {
        AttitudeFilterMemory filter; ///< estimate and rates
    } mem;
} AttitudeMekf;

void attitude_mekf_reset(AttitudeMekf *m);
void attitude_mekf_update(AttitudeMekf *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ATTITUDE_UKF_H
#define FLIGHT_NAVIGATION_ATTITUDE_UKF_H

#include "flight/navigation/attitude_filter.h"

/** The attitude from star tracker and gyro by a square-root unscented Kalman filter on MRP and the gyro's bias. It
 *  carries deviations through the motion itself instead of a linear one, and changes to the shadow set, with the
 *  covariance, where |sigma| passes 1. Late and wrong attitudes, and gaps of the gyro, it treats as AttitudeMekf does.
 *  Sources: Karlgaard and Schaub 2009; van der Merwe and Wan 2001; attitude_filter.h has the equations. */
typedef struct AttitudeUkf {
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
} AttitudeUkf;

void attitude_ukf_reset(AttitudeUkf *m);
void attitude_ukf_update(AttitudeUkf *m, Tick t);

#endif

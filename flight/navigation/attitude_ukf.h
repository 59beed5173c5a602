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
    struct {
        double rate_noise; ///< [rad^2/s] required, > 0: the square of the noise density of the rates
        double bias_walk;  ///< [rad^2/s^3] required, > 0: the variance that its bias gains per second
        double bias_std;   ///< [rad/s] required, > 0: standard deviation of its bias at the start
        double star_std;   ///< [rad] required, > 0: error of measured attitudes about each axis besides what they say
        double gate;       ///< [-] required, > 0: normalised innovation above which an attitude does not fit
        double hold;       ///< [s] required, > 0: longest gap between rates that can be bridged
        double coast;      ///< [s] required, > 0: longest time since the last measured attitude for a good result
        uint32_t persistence; ///< [-] required, > 0: attitudes that agree until it begins anew, or until it is good
        uint32_t spare;
    } par;
    struct {
        AttitudeFilterMemory filter; ///< estimate and rates
    } mem;
} AttitudeUkf;

void attitude_ukf_reset(AttitudeUkf *m);
void attitude_ukf_update(AttitudeUkf *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* What sensors of the motion measure. The head has the time of the measurement, which is earlier than the message where
 * a sensor needs time. The position and the velocity of a receiver are a NavOrbit. */
#ifndef FLIGHT_MSG_SENSORS_H
#define FLIGHT_MSG_SENSORS_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** The attitude that a star tracker measures. */
typedef struct StarAttitude {
    Head head;
    Vec3 sigma_BN; ///< [-]     attitude of B relative to N, |sigma| <= 1
    Mat3 P_B;      ///< [rad^2] covariance of its error, a small turn about the axes of B, as the sensor believes it
} StarAttitude;

/** The angular rate that gyros measure. */
typedef struct GyroRate {
    Head head;
    Vec3 omega_BN_B; ///< [rad/s] of B relative to N, B components
} GyroRate;

/** Whether a rate can be used: it is not missing, not stale, finite and below 1000 rad/s. */
static inline int gyro_speaks(const GyroRate *gyro)
{
    return gyro->head.quality >= QUALITY_DEGRADED && vec_norm2(gyro->omega_BN_B) < 1e6;
}

/** What accelerometers measure: the acceleration of their place less gravity. They count its integral, so that nothing
 *  is lost between two readings. */
typedef struct SpecificForce {
    Head head;
    Vec3 f_B;  ///< [m/s^2] its mean over the sensor's last step, B components
    Vec3 dv_B; ///< [m/s]   its integral since the sensor began, B components
} SpecificForce;

/** Another spacecraft T, as a sensor of the spacecraft B sees it. */
typedef struct SeenCraft {
    Head head;
    Vec3 r_TB_B;     ///< [m]     position of T relative to B, B components
    Vec3 v_TB_B;     ///< [m/s]   difference of their velocities relative to N, B components
    Vec3 sigma_TB;   ///< [-]     attitude of T relative to B, |sigma| <= 1
    Vec3 omega_TB_B; ///< [rad/s] angular rate of T relative to B, B components
} SeenCraft;

#endif

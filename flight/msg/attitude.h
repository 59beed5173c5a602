/* SPDX-License-Identifier: Apache-2.0 */
/* Attitude messages. Attitudes are Modified Rodrigues Parameters with |sigma| <= 1.
 *
 * Example:
 *
 *     static void turn(const NavAttitude *in, EulerAngles *out, Tick t)
 *     {
 *         if (head_written(in->head) && !data_lost(t, in->head.t, 3.0)) {
 *             out->angles = in->sigma_BN; // of small angles, a quarter
 *             out->head = head_next(out->head, t.t, quality_through(in->head)); // degraded if the input is stale
 *         } else {
 *             out->head = head_held(out->head);
 *         }
 *     }
 */
#ifndef FLIGHT_MSG_ATTITUDE_H
#define FLIGHT_MSG_ATTITUDE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** Where the body should point: a reference frame R and its motion relative to N. */
typedef struct AttReference {
    Head head;
    Vec3 sigma_RN;    ///< [-]       attitude of R relative to N
    Vec3 omega_RN_N;  ///< [rad/s]   angular rate of R relative to N, N components
    Vec3 domega_RN_N; ///< [rad/s^2] inertial derivative of omega_RN_N, N components
} AttReference;

/** How far the body is from its reference, with what feedback needs of the reference's motion. */
typedef struct AttError {
    Head head;
    Vec3 sigma_BR;    ///< [-]       attitude of B relative to R
    Vec3 omega_BR_B;  ///< [rad/s]   angular rate of B relative to R, B components
    Vec3 omega_RN_B;  ///< [rad/s]   angular rate of R relative to N, B components
    Vec3 domega_RN_B; ///< [rad/s^2] inertial derivative of the rate of R, B components
} AttError;

/** The navigated attitude of the body. */
typedef struct NavAttitude {
    Head head;
    Vec3 sigma_BN;   ///< [-]     attitude of B relative to N
    Vec3 omega_BN_B; ///< [rad/s] angular rate of B relative to N, B components
} NavAttitude;

/** A set of 3-2-1 Euler angles (yaw psi, pitch theta, roll phi) and their rates. */
typedef struct EulerAngles {
    Head head;
    Vec3 angles; ///< [rad]   psi, theta, phi
    Vec3 rates;  ///< [rad/s] their time derivatives
} EulerAngles;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The motion of the spacecraft and of celestial bodies. An acceleration is that by all forces;
 * where it is not known it is zero, and each module that uses it says what is lost. */
#ifndef FLIGHT_MSG_ORBIT_H
#define FLIGHT_MSG_ORBIT_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** The navigated motion of the spacecraft. */
typedef struct NavOrbit {
    Head head;
    Vec3 r_BN_N; ///< [m]     position of B relative to the origin of N
    Vec3 v_BN_N; ///< [m/s]   velocity of B relative to N
    Vec3 a_BN_N; ///< [m/s^2] acceleration of B relative to N, where known, else zero
} NavOrbit;

/** The motion of a celestial body. */
typedef struct BodyState {
    Head head;
    Vec3 r_PN_N; ///< [m]     position of the body relative to the origin of N
    Vec3 v_PN_N; ///< [m/s]   velocity of the body relative to N
    Vec3 a_PN_N; ///< [m/s^2] acceleration of the body relative to N, where known, else zero
} BodyState;

#endif

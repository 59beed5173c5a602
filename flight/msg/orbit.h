/* SPDX-License-Identifier: Apache-2.0 */
/* Positions and velocities of the spacecraft and of celestial bodies. */
#ifndef FLIGHT_MSG_ORBIT_H
#define FLIGHT_MSG_ORBIT_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** The navigated position and velocity of the spacecraft. */
typedef struct NavOrbit {
    Head head;
    Vec3 r_BN_N; ///< [m]   position of B relative to the origin of N
    Vec3 v_BN_N; ///< [m/s] velocity of B relative to N
} NavOrbit;

/** The position and velocity of a celestial body. */
typedef struct BodyState {
    Head head;
    Vec3 r_PN_N; ///< [m]   position of the body relative to the origin of N
    Vec3 v_PN_N; ///< [m/s] velocity of the body relative to N
} BodyState;

#endif

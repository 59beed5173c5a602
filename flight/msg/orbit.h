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

/** In which shadow the spacecraft is. */
typedef enum ShadowPhase {
    SHADOW_SUNLIT = 0,   ///< the whole disc of the Sun is seen
    SHADOW_PENUMBRA = 1, ///< a part of it, also a ring
    SHADOW_UMBRA = 2     ///< nothing of it
} ShadowPhase;

/** The sunlight at the spacecraft. */
typedef struct ShadowState {
    Head head;
    double lit;        ///< [-] in [0, 1]: part of the Sun's disc that is seen
    double change;     ///< [s] >= 0: until the phase changes; 0: no change is known
    ShadowPhase phase; ///< [-] in which shadow
    uint32_t spare;
} ShadowState;

/** Why SGP4 gives no position; up to 6 with the numbers of the published programs. */
typedef enum OrbitElementsCode {
    ORBIT_ELEMENTS_GOOD = 0,         ///< it gives one
    ORBIT_ELEMENTS_ECCENTRICITY = 1, ///< the mean eccentricity, with drag, is not in [-0.001, 1)
    ORBIT_ELEMENTS_MOTION = 2,       ///< the mean motion is not > 0
    ORBIT_ELEMENTS_PERTURBED = 3,    ///< the eccentricity, with the pull of Sun and Moon, is not in [0, 1]
    ORBIT_ELEMENTS_LATUS = 4,        ///< the semi-latus rectum is < 0
    ORBIT_ELEMENTS_DECAYED = 6,      ///< the position is below the Earth's surface
    ORBIT_ELEMENTS_UNSOUND = 7,      ///< the elements are no orbit of a satellite: a number is not finite
    ORBIT_ELEMENTS_FAR = 8           ///< a resonant orbit, 1000 days or more from its epoch
} OrbitElementsCode;

/** How the mean elements stand of which an orbit is computed. */
typedef struct OrbitElementsState {
    Head head;
    double age;             ///< [s] since their epoch; < 0: before it
    OrbitElementsCode code; ///< [-] why there is no position
    uint32_t deep;          ///< [-] 1: an orbit of 225 minutes or more, pulled by Sun and Moon
} OrbitElementsState;

#endif

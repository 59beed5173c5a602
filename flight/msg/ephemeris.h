/* SPDX-License-Identifier: Apache-2.0 */
/* Ephemerides on board, and the times that they and theories count. */
#ifndef FLIGHT_MSG_EPHEMERIS_H
#define FLIGHT_MSG_EPHEMERIS_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

#define EPHEMERIS_TERMS 16
#define EPHEMERIS_SEGMENTS 8

/** TDB since the epoch of the ephemerides, which count it. UTC is more than a minute behind it. */
typedef struct EphemerisTime {
    Head head;
    int64_t time; ///< [ns] now
} EphemerisTime;

/** UTC since 2000-01-01T12:00:00, 86,400 s a day. What flight knows of the Earth, the Sun and the Moon by theories
 *  counts it. */
typedef struct UtcTime {
    Head head;
    int64_t time; ///< [ns] now
} UtcTime;

/** The position of a body over a span of time: the sum of c_k T_k(x), with x from -1 at its start to 1 at its end. */
typedef struct EphemerisBlock {
    Head head;
    int64_t start;           ///< [ns] of the ephemeris' time
    int64_t duration;        ///< [ns] > 0: until its end
    uint32_t n;              ///< [-] in [1, 16]: number of coefficients
    uint32_t number;         ///< [-] another one than that of the last block
    Vec3 c[EPHEMERIS_TERMS]; ///< [m] count n: coefficients of Chebyshev polynomials, N components
} EphemerisBlock;

/** What an ephemeris has. */
typedef struct EphemerisState {
    Head head;
    double left;      ///< [s] until the end of what covers the time now; 0: nothing covers it
    uint32_t taken;   ///< [-] blocks
    uint32_t refused; ///< [-] blocks
} EphemerisState;

/** How a planet P is turned, and turns. */
typedef struct PlanetAttitude {
    Head head;
    Mat3 dcm_PN;     ///< [-]     attitude of P relative to N; the third axis is the pole
    Vec3 omega_PN_N; ///< [rad/s] angular rate of P relative to N, N components
} PlanetAttitude;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* SGP4, and SDP4 for orbits of 225 minutes or more: position and velocity of a satellite of the Earth in TEME, the true
 * equator and mean equinox of date, of the mean elements that two-line elements and OMMs publish.
 *
 * The elements are averaged over the orbit by Brouwer's theory, with the zonal harmonics J2 to J4 and drag in an air
 * whose density falls with the fourth power of the height. Deep-space orbits have the pull of Sun and Moon besides, and
 * those of half a day or a day their resonance with the Earth's tesseral harmonics, integrated in steps of half a day.
 * The constants are those of WGS 72, by which the elements are fitted; the mode is the "improved" one.
 * Source: Hoots and Roehrich, Spacetrack Report 3, 1980; Vallado and others, AIAA 2006-6753; Hoots, Schumacher and
 * Glover 2004. */
#ifndef FLIGHT_NAVIGATION_SGP4_H
#define FLIGHT_NAVIGATION_SGP4_H

#include "flight/math/vec.h"
#include "flight/msg/orbit.h"

#define SGP4_MU 398600.8e9    /* [m^3/s^2] of WGS 72 */
#define SGP4_RADIUS 6378135.0 /* [m] */
#define SGP4_J2 0.001082616
#define SGP4_J3 (-0.00000253881)
#define SGP4_J4 (-0.00000165597)
#define SGP4_STEPS 2000 /* of the resonance, most: 1000 days */

/** Mean elements of SGP4, in TEME of their epoch. */
typedef struct Sgp4Elements {
    int64_t epoch;    ///< [ns] UTC since 2000-01-01T12:00:00, 86,400 s a day
    double n;         ///< [rad/s] mean motion of Kozai's theory, as published
    double e;         ///< [-] eccentricity
    double i;         ///< [rad] inclination
    double node;      ///< [rad] right ascension of the ascending node
    double periapsis; ///< [rad] argument of perigee
    double M;         ///< [rad] mean anomaly
    double bstar;     ///< [-] drag, B* for lengths in Earth radii, as published
} Sgp4Elements;

/** What is computed once of the elements; lengths are in Earth radii. With the time t [s] since the epoch,
 *      n a^(3/2) = const,   a / a0 = (1 - A1 t - ... - A4 t^4)^2,   M = M0 + dM t + n (L2 t^2 + ... + L5 t^5) + ... */
typedef struct Sgp4 {
    Sgp4Elements elements;    ///< of which it was computed
    double n;                 ///< [rad/s] mean motion of Brouwer's theory
    double dM;                ///< [rad/s] rate of the mean anomaly
    double dperiapsis;        ///< [rad/s] rate of the argument of perigee
    double dnode;             ///< [rad/s] rate of the node
    double ddnode;            ///< [rad/s^2] half of its change by drag
    double A[4];              ///< [SI] drag on the semi-major axis, by powers of time
    double L[4];              ///< [SI] drag on the mean longitude, by powers of time from 2
    double e1;                ///< [1/s] drag on the eccentricity, of time
    double e2;                ///< [-] drag on the eccentricity, of the anomaly
    double w1;                ///< [rad/s] drag on the perigee, of time
    double w2;                ///< [rad] drag on the perigee, of the anomaly
    double eta;               ///< [-] by which the drag changes along the orbit
    double cube;              ///< [-] (1 + eta cos M)^3 at the epoch
    double sine;              ///< [-] sin M at the epoch
    double theta;             ///< [rad] sidereal time at the epoch
    double phase[2];          ///< [rad] mean anomaly at the epoch, of Sun and Moon
    double periodic[2][5][3]; ///< [rad] of Sun and Moon: on e, i, M, periapsis, node; of three functions of the phase
    double secular[5];        ///< [rad/s] of both: on e, i, M, periapsis, node
    double tesseral[10];      ///< [rad/s^2] amplitudes of the resonance
    double angle0;            ///< [rad] resonant angle at the epoch
    double dangle;            ///< [rad/s] its rate, less the mean motion
    double time;              ///< [s] since the epoch: to where the resonance is integrated
    double angle;             ///< [rad] resonant angle then
    double motion;            ///< [rad/s] mean motion then
    uint32_t deep;            ///< [-] 1: SDP4
    uint32_t resonance;       ///< [-] 0: none, 1: of a day, 2: of half a day
} Sgp4;

/** Compute the constants of an orbit. Returns a code, which refuses elements that are not those of an ellipse. */
OrbitElementsCode sgp4_init(Sgp4 *s, Sgp4Elements elements);

/** Position [m] and velocity [m/s] in TEME at a time [s] since the epoch, which do not depend on earlier calls: of s,
 *  only how far the resonance is integrated changes. Where the code is not GOOD, both are of no use. */
OrbitElementsCode sgp4_state(Sgp4 *s, double t, Vec3 *r, Vec3 *v);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ELEMENT_EPHEMERIS_H
#define FLIGHT_NAVIGATION_ELEMENT_EPHEMERIS_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"

/** The motion on an orbit by its elements: as that of this spacecraft, or as that of another body. An ellipse has a > 0
 *  and e < 1; a hyperbola a < 0 and e > 1, and M = e sinh H - H; other pairs are no orbit, and nothing is written. No
 *  digit is lost near e = 1 if a is q / (1 - e) by that very double e; with the doubles next to 1, it is the parabola.
 *  With J2, node, periapsis and mean anomaly of an ellipse change at their secular rates; a hyperbola has none, and J2
 *  does not count. With p = a (1 - e^2), k = 3/4 J2 (radius / p)^2 n:
 *      dOmega = -2 k cos i,   domega = k (5 cos^2 i - 1),   dM = n + k sqrt(1 - e^2) (3 cos^2 i - 1),
 *  for mean elements whose third axis is the pole. Velocity and acceleration are the derivatives of the position.
 *  Source: Vallado, chapters 2 and 9. */
typedef struct ElementEphemeris {
    struct {
        EphemerisTime time; ///< optional: without it, flight's time is that of the elements
    } in;
    struct {
        NavOrbit orbit;
        BodyState body;
    } out;
    struct {
        int64_t epoch;    ///< [ns] of the elements
        double mu;        ///< [m^3/s^2] required, > 0: of the central body
        double a;         ///< [m] required, non-zero: semi-major axis, < 0 of a hyperbola
        double e;         ///< [-] in [0, 100]: eccentricity
        double i;         ///< [rad] inclination
        double node;      ///< [rad] right ascension of the ascending node
        double periapsis; ///< [rad] argument of periapsis
        double M;         ///< [rad] mean anomaly at the epoch
        double J2;        ///< [-] in [-1, 1]: of the central body; 0: the elements rest
        double radius;    ///< [m] >= 0: to which J2 belongs
    } par;
} ElementEphemeris;

void element_ephemeris_reset(ElementEphemeris *m);
void element_ephemeris_update(ElementEphemeris *m, Tick t);

#endif

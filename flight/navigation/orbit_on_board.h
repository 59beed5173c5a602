/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ORBIT_ON_BOARD_H
#define FLIGHT_NAVIGATION_ORBIT_ON_BOARD_H

#include "flight/msg/ephemeris.h"
#include "flight/navigation/sgp4.h"

/** The orbit of this spacecraft by SGP4 or SDP4, of the mean elements that the ground sends: those of a two-line
 *  element set or of an OMM, which `fledge.mean_elements` reads. The elements may change at any time, all by one
 *  command; the next update takes the new ones. Where SGP4 gives no position, the orbit is held, degraded, and the
 *  state says why. Elements older than age_max, or as long before their epoch, degrade the orbit. In TEME, with the
 *  pole e3, the acceleration is that by the gravity of a point and J2:
 *      a = -mu / r^3 (r + 1.5 J2 (R / r)^2 ((1 - 5 z^2 / r^2) r + 2 z e3));
 *  it lacks air, Sun and Moon. The turn of TEME in N is left out of the velocity, up to 1e-4 m/s near the Earth.
 *  Source: Hoots and Roehrich, Spacetrack Report 3; Vallado and others, AIAA 2006-6753. */
typedef struct OrbitOnBoard {
    struct {
        UtcTime time;
    } in;
    struct {
        NavOrbit orbit;
        OrbitElementsState state;
    } out;
    struct {
        int64_t epoch;    ///< [ns] UTC since 2000-01-01T12:00:00: of the elements
        double n;         ///< [rad/s] required, > 0: mean motion, as published
        double e;         ///< [-] >= 0, < 1: eccentricity
        double i;         ///< [rad] in [0, 3.1416]: inclination
        double node;      ///< [rad] right ascension of the ascending node
        double periapsis; ///< [rad] argument of perigee
        double M;         ///< [rad] mean anomaly
        double bstar;     ///< [-] drag, B* for lengths in Earth radii, as published
        double age_max;   ///< [s] >= 0: elements that are older degrade the orbit; 0: never
    } par;
    struct {
        Sgp4 sgp4;    ///< what is computed once of the elements
        uint32_t any; ///< [-] 1 once it was
        uint32_t spare;
    } mem;
} OrbitOnBoard;

void orbit_on_board_reset(OrbitOnBoard *m);
void orbit_on_board_update(OrbitOnBoard *m, Tick t);

#endif

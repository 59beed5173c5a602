/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_GROUND_TARGET_H
#define FLIGHT_GUIDANCE_GROUND_TARGET_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/ground.h"
#include "flight/msg/orbit.h"

/** The motion of a place on a planet, and where it sees the spacecraft: what pointing at a ground station needs
 *  (TwoBodyPointing, with the place as its primary body) and what says when to.
 *  The place is given by its longitude, geodetic latitude and altitude on an ellipsoid of revolution. The planet turns
 *  about its pole p3 at a constant rate, from the orientation that it has at time 0 of the run:
 *     [PN](t) = R3(rate t) [PN](0),   v = omega x r,   a = omega x v
 *  For the Earth, with rate and orientation of the epoch, the error grows by 2 m a day. Where an attitude is wired, the
 *  planet turns on from that, by its rate.
 *  Without an orbit, and ten updates after the last one, the place sees nothing. Axes of the planet that span no frame
 *  give no place.
 *  Refraction, which lifts the spacecraft near the horizon by 0.5 deg, is left out.
 *  Source: Vallado, sections 3.2 (geodetic latitude) and 4.4 (azimuth and elevation). */
typedef struct GroundTarget {
    struct {
        NavOrbit orbit;
        BodyState planet;        ///< optional: without it the planet's centre rests at the origin of N
        PlanetAttitude attitude; ///< optional: how the planet is turned, as EarthOnBoard knows it
    } in;
    struct {
        BodyState target;
        GroundContact contact;
    } out;
    struct {
        double longitude;  ///< [rad] required, in [-6.2832, 6.2832]: east of the prime meridian
        double latitude;   ///< [rad] required, in [-1.5708, 1.5708]: geodetic
        double altitude;   ///< [m] in [-1e7, 1e9]: over the ellipsoid
        double radius;     ///< [m] required, in [1, 1e9]: of the equator
        double flattening; ///< [-] in [0, 0.9]: of the ellipsoid
        Mat3 dcm_PN;       ///< [-] attitude of the planet relative to N at time 0, where none is wired
        double rate;       ///< [rad/s] at which the planet then turns about p3
        double mask;       ///< [rad] in [-1.5708, 1.5708]: from where on the place sees the spacecraft
    } par;
} GroundTarget;

void ground_target_reset(GroundTarget *m);
void ground_target_update(GroundTarget *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_GROUND_PASS_H
#define FLIGHT_NAVIGATION_GROUND_PASS_H

#include "flight/msg/ground.h"
#include "flight/msg/orbit.h"
#include "flight/navigation/orbit_motion.h"

/** How far a search for a pass has come. */
typedef enum PassSearch {
    SEARCH_NONE = 0,  ///< it has not begun
    SEARCH_BELOW = 1, ///< the spacecraft is below the mask
    SEARCH_ABOVE = 2, ///< the rise is found
    SEARCH_DONE = 3   ///< the set is found
} PassSearch;

/** When the spacecraft passes over a ground station next: rise, highest and set against the station's mask, so that
 *  flight can prepare the pass, and begin and end it without the ground.
 *  The orbit is predicted with the planet's point mass and J2, its turning with the constant rate that it has now, in
 *  steps of `step`, at most `steps` an update. With the vector d from the station to the spacecraft in axes of the
 *  planet, between two steps a cubic (Hermite), the elevation has
 *     s = up . d / |d|,   ds/dt = (up . d' - s d . d' / |d|) / |d|;
 *  bisection finds where ds/dt changes its sign, then where s is the sine of the mask. A pass shorter than a step is
 *  found too; two culminations within one step are not distinguished.
 *  The search looks `horizon` ahead of now, and goes on with time where it finds none. It begins anew when the pass is
 *  over, when the station or the mask is changed, when the clock goes back, and when the spacecraft is farther than
 *  `differ` from where it was predicted to be: then the last forecast stands, degraded, until there is another one.
 *  Where it begins within a pass of which it does not know the rise, that is the time of the orbit; a set more than a
 *  horizon after the horizon's end is cut off there.
 *  The forecast goes on without new orbits: degraded ten updates after the last one.
 *  Refraction, which lifts the spacecraft near the horizon by 0.5 deg, is left out.
 *  Source: Vallado, sections 3.2 and 11.2. */
typedef struct GroundPass {
    struct {
        NavOrbit orbit;
        PlanetAttitude planet;
    } in;
    struct {
        PassForecast forecast;
    } out;
    struct {
        double longitude;  ///< [rad] required, in [-6.2832, 6.2832]: of the station, east of the prime meridian
        double latitude;   ///< [rad] required, in [-1.5708, 1.5708]: geodetic
        double altitude;   ///< [m] in [-1e7, 1e9]: over the ellipsoid
        double radius;     ///< [m] required, in [1, 1e9]: of the equator; J2 belongs to it too
        double flattening; ///< [-] in [0, 0.9]: of the ellipsoid
        double mask;       ///< [rad] in [-1.5708, 1.5708]: elevation from where on the station sees the spacecraft
        double mu;         ///< [m^3/s^2] required, > 0: of the planet
        double J2;         ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double horizon;    ///< [s] required, in [60, 86400]: how far it looks ahead
        double step;       ///< [s] required, in [0.1, 600]: of the prediction
        double differ;     ///< [m] required, > 0: from the prediction, until it searches anew
        uint32_t steps;    ///< [-] required, in [1, 1000]: most steps of an update, for each of two predictions
        uint32_t spare;
    } par;
    struct {
        OrbitPoint at;     ///< how far the orbit is searched
        OrbitPoint follow; ///< where the spacecraft is predicted to be now
        Mat3 dcm_PN;       ///< [-]     attitude of the planet when the search began
        Vec3 station;      ///< [m]     for which it searches, P components
        double rate;       ///< [rad/s] of the planet about its pole
        double sine;       ///< [-]     sine of the mask
        double best;       ///< [-]     sine of the highest elevation
        int64_t start;     ///< [ns]    of the orbit that the search began from
        int64_t t;         ///< [ns]    of `at`
        int64_t followed;  ///< [ns]    of `follow`
        int64_t now;       ///< [ns]    of the last update
        int64_t rise;      ///< [ns]    as PassForecast has it, and what follows
        int64_t highest;   ///< [ns]    highest
        int64_t set;       ///< [ns]    set
        PassSearch search; ///< [-]     how far it has come
        uint32_t searches; ///< [-]     how often it began
    } mem;
} GroundPass;

void ground_pass_reset(GroundPass *m);
void ground_pass_update(GroundPass *m, Tick t);

#endif

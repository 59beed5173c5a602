/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ORBIT_PROPAGATOR_H
#define FLIGHT_NAVIGATION_ORBIT_PROPAGATOR_H

#include "flight/msg/orbit.h"
#include "flight/navigation/orbit_motion.h"

/** The orbit now, from the last fix: of the ground, or of a receiver that is switched on now and then. Each new fix
 *  begins the motion anew at the time in its head; it goes on by point mass and zonal harmonics about the pole,
 *      d^2 r / dt^2 = grad V,   V = mu / |r| (1 - sum of J_n (radius / |r|)^n P_n(sin latitude)),   n = 2, 3, 4,
 *  in steps of Runge and Kutta's method of order 4. An update makes at most `steps` of them. After a longer gap it
 *  catches up over several updates; until then its output is degraded and of the time that it has reached.
 *  A fix of a time to come waits. One whose numbers are no orbit is not used, and the last motion goes on. If the clock
 *  goes back behind the motion, it begins anew with the fix that there is. A degraded fix, and one that is older than
 *  age_max, degrade the output.
 *  Source: Vallado, section 8.6. */
typedef struct OrbitPropagator {
    struct {
        NavOrbit fix;
        PlanetAttitude planet; ///< optional: its pole; without it, that is the third axis of N
    } in;
    struct {
        NavOrbit orbit;
    } out;
    struct {
        double mu;      ///< [m^3/s^2] required, > 0: of the planet
        double radius;  ///< [m] >= 0: to which the zonal harmonics belong
        double J2;      ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double J3;      ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double J4;      ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double step;    ///< [s] required, in [0.001, 3600]: longest step
        double age_max; ///< [s] required, > 0: oldest fix for a good orbit
        uint32_t steps; ///< [-] required, in [1, 1000]: most steps of an update
        uint32_t spare;
    } par;
    struct {
        OrbitPoint at;     ///< where it is
        int64_t t;         ///< [ns] then
        int64_t fixed;     ///< [ns] time of the fix from which it began
        uint32_t sequence; ///< [-] of that fix
        Quality quality;   ///< [-] of that fix; none: it has not begun
    } mem;
} OrbitPropagator;

void orbit_propagator_reset(OrbitPropagator *m);
void orbit_propagator_update(OrbitPropagator *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_FORMATION_KEEPING_H
#define FLIGHT_GUIDANCE_FORMATION_KEEPING_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"
#include "flight/msg/relative.h"
#include "flight/msg/thrusters.h"

/** Keep a deputy D on a wanted motion relative to a chief C, with a force. Wanted, in the chief's Hill frame, is
 *     rho* = (a cos u, lead - 2 a sin u, b cos (u + phase)),   u = sqrt(mu / r_0^3) t + start
 *  with r_0 the chief's distance at the first update: about a chief on a circle of that radius the free motion of
 *  Clohessy and Wiltshire, so that it costs next to nothing. The force on the deputy is
 *     F = m [ddr* - g(r)] - m (K e + P de),   e = r - r*
 *  with g of the planet's point mass and r* the wanted motion in N, so that dde = -K e - P de exactly, about any conic.
 *  A sphere of the size `quiet` about the wanted motion, and quiet times sqrt(K) in velocity, has no force. The force
 *  is at most force_max. A chief and an orbit of an earlier time are carried to now by the planet's gravity. Without a
 *  fresh chief, orbit or attitude, the force goes on for `hold`, degraded, and is then zero.
 *  Source: Schaub and Junkins, chapter 14 (Hill frame, linear motion, Cartesian feedback). */
typedef struct FormationKeeping {
    struct {
        NavOrbit orbit;
        NavAttitude attitude;
        BodyState chief;
        BodyState planet; ///< optional: without it the planet rests at the origin of N
    } in;
    struct {
        BodyForce force;
        HillState relative;
    } out;
    struct {
        double mu;        ///< [m^3/s^2] required, > 0: gravitational parameter of the planet
        double mass;      ///< [kg] required, > 0: of the deputy
        double a;         ///< [m] in [-1e9, 1e9]: half the size of the ellipse in the plane of the orbit, across
        double b;         ///< [m] in [-1e9, 1e9]: amplitude across the plane of the orbit
        double lead;      ///< [m] in [-1e9, 1e9]: of the ellipse's centre along the orbit
        double start;     ///< [rad] u at the first update
        double phase;     ///< [rad] of the motion across the plane
        double K;         ///< [1/s^2] required, > 0: gain on the position
        double P;         ///< [1/s] required, > 0: gain on the velocity
        double quiet;     ///< [m] in [0, 1e9]: error below which there is no force
        double force_max; ///< [N] >= 0: largest force; 0: unlimited
        double hold;      ///< [s] >= 0: how long the force goes on without new data; 0: ten updates
    } par;
    struct {
        double n;        ///< [rad/s] rate of u
        int64_t origin;  ///< [ns] of the first update
        int64_t newest;  ///< [ns] of the newest data that were used
        int32_t running; ///< [-] 1: there was an update
        int32_t spare;
    } mem;
} FormationKeeping;

void formation_keeping_reset(FormationKeeping *m);
void formation_keeping_update(FormationKeeping *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_BODY_DIRECTION_H
#define FLIGHT_SENSING_BODY_DIRECTION_H

#include "flight/msg/navigation.h"
#include "flight/msg/orbit.h"
#include "flight/msg/sun.h"

/** Pairs the direction in which a sensor sees a celestial body with that in which it stands: of the Sun, or of the
 *  planet whose horizon a sensor sees. With the time t of the measurement and the ages of what is known at it,
 *      d_N = unit(r_PN_N + v_PN_N age_P - (r_BN_N + v_BN_N age_B)).
 *  Each measurement is given once, with its time: until the next, the output stays as it is. One of a time to come
 *  waits. Without a heading, or where no direction results, the output is held, degraded.
 *  Assumptions: bodies and spacecraft move straight on for as long as a measurement is old. Without an orbit, the body
 *  is seen from the origin of N, which misplaces the Sun by up to 5e-5 rad at 7,000 km. */
typedef struct BodyDirection {
    struct {
        SunHeading heading; ///< as measured, of whatever body it is
        BodyState body;     ///< optional: with `central`, it is not needed
        NavOrbit orbit;     ///< optional: without it, the body is seen from the origin of N
    } in;
    struct {
        SeenDirection seen;
    } out;
    struct {
        double std;       ///< [rad] required, > 0: standard deviation of the measured direction, about each axis across
        uint32_t central; ///< [-] in [0, 1]: 1: the body is at the origin of N, as the Earth is for a horizon sensor
        uint32_t spare;
    } par;
} BodyDirection;

void body_direction_reset(BodyDirection *m);
void body_direction_update(BodyDirection *m, Tick t);

#endif

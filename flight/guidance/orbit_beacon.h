/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_ORBIT_BEACON_H
#define FLIGHT_GUIDANCE_ORBIT_BEACON_H

#include "flight/msg/orbit.h"

/** Tell others where this spacecraft will be, as a body that they can point at.
 *  What is said at t is for t + lead: with the time that it takes to be read, the reader's error is
 *  that of a constant acceleration over this time. */
typedef struct OrbitBeacon {
    struct {
        NavOrbit orbit;
    } in;
    struct {
        BodyState body; ///< head.t is when it was said
    } out;
    struct {
        double lead; ///< [s] in [0, 1000]: how far ahead
    } par;
} OrbitBeacon;

void orbit_beacon_reset(OrbitBeacon *m);
void orbit_beacon_update(OrbitBeacon *m, Tick t);

#endif

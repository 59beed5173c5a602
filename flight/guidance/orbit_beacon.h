/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_ORBIT_BEACON_H
#define FLIGHT_GUIDANCE_ORBIT_BEACON_H

#include "flight/msg/orbit.h"

/** Predict where this spacecraft will be, as a body that other spacecraft can point at.
 *  The output at t holds the position for t + lead. If `lead` is the delay until a reader uses it, the
 *  reader's error is that of assuming a constant acceleration over this time. */
typedef struct OrbitBeacon {
    struct {
        NavOrbit orbit;
    } in;
    struct {
        BodyState body; ///< head.t is when it was computed
    } out;
    struct {
        double lead; ///< [s] in [0, 1000]: how far ahead
    } par;
} OrbitBeacon;

void orbit_beacon_reset(OrbitBeacon *m);
void orbit_beacon_update(OrbitBeacon *m, Tick t);

#endif

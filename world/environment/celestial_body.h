/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_CELESTIAL_BODY_H
#define WORLD_ENVIRONMENT_CELESTIAL_BODY_H

#include "flight/msg/orbit.h"

/** Where a body of the solar system is, by an ephemeris: of the truth, or for flight modules that
 *  are given it. N has its origin in the sky's centre.
 *  Assumptions: geometric, neither light time nor aberration. */
typedef struct CelestialBody {
    struct {
        BodyState state;
    } out;
    struct {
        int32_t id; ///< [-] required: NAIF number of the body, which Python's `body` sets
        int32_t spare;
    } par;
} CelestialBody;

#endif

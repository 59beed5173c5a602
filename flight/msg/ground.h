/* SPDX-License-Identifier: Apache-2.0 */
/* Ground stations. Their own motion is a BodyState. */
#ifndef FLIGHT_MSG_GROUND_H
#define FLIGHT_MSG_GROUND_H

#include "flight/msg/head.h"

/** Where a ground station sees the spacecraft. */
typedef struct GroundContact {
    Head head;
    double range;      ///< [m] from the station to the spacecraft
    double range_rate; ///< [m/s] its derivative
    double azimuth;    ///< [rad] in [0, 6.283185307179586]: from north towards east
    double elevation;  ///< [rad] over the station's horizon
    uint32_t visible;  ///< [-] in [0, 1]: 1: above the station's mask
    uint32_t spare;
} GroundContact;

/** How the search for the next pass stands. */
typedef enum PassState {
    PASS_SEARCHING = 0, ///< not found yet
    PASS_FOUND = 1,     ///< it is to come
    PASS_NOW = 2,       ///< it has begun
    PASS_NONE = 3       ///< there is none within the horizon of the search
} PassState;

/** The next pass over a ground station, or the one that has begun. All times are 0 unless there is one. */
typedef struct PassForecast {
    Head head;
    int64_t rise;      ///< [ns] flight's time when the spacecraft rises above the station's mask
    int64_t highest;   ///< [ns] flight's time when it is highest
    int64_t set;       ///< [ns] flight's time when it sets below the mask
    double elevation;  ///< [rad] over the station's horizon, at the highest
    PassState state;   ///< [-] how the search stands
    uint32_t searches; ///< [-] how often it began since the reset
} PassForecast;

#endif

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

#endif

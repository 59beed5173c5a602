/* SPDX-License-Identifier: Apache-2.0 */
/* What guidance modules exchange beside the references themselves, and what they report. */
#ifndef FLIGHT_MSG_GUIDANCE_H
#define FLIGHT_MSG_GUIDANCE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** 3-2-1 Euler angles that change at constant rates: angles + rates (t - start) at a time t. It
 *  does not matter when the command arrives; before its start, what was in effect goes on. */
typedef struct EulerCommand {
    Head head;
    int64_t start; ///< [ns] >= 0: when it takes effect
    Vec3 angles;   ///< [rad]   psi, theta, phi at the start
    Vec3 rates;    ///< [rad/s] their constant rates
} EulerCommand;

#define RASTERS_MAX 16

/** A list of rasters, flown one after the other from the start on: the first n entries count. */
typedef struct RasterList {
    Head head;
    int64_t start;                 ///< [ns] >= 0: when the first raster begins
    uint32_t n;                    ///< [-] in [1, 16]: number of rasters
    uint32_t repeat;               ///< [-] in [0, 1]: 1: begin anew after the last; 0: hold its end
    Vec3 angles[RASTERS_MAX];      ///< [rad]   count n: psi, theta, phi where each begins
    Vec3 rates[RASTERS_MAX];       ///< [rad/s] count n: their constant rates
    double durations[RASTERS_MAX]; ///< [s] count n, > 0, <= 5e8: how long each lasts, to the
                                   ///< nearest ns
} RasterList;

/** Where the raster manager stands. */
typedef struct RasterStatus {
    Head head;
    int64_t elapsed;  ///< [ns] since the raster in effect began; if done, since the last one ended
    int64_t cycle;    ///< [-]  how many times the whole list was completed
    uint32_t index;   ///< [-]  the raster in effect, from 0; the last one, if done
    uint32_t done;    ///< [-]  1 if the list has ended and its end is held
    uint32_t refused; ///< [-]  1 if the list at the input is refused, and the one before stays
    uint32_t spare;
} RasterStatus;

/** What the secondary body does for two-body pointing. */
typedef enum SecondaryUse {
    SECONDARY_ABSENT = 0,    ///< never written: no turn about the primary's direction
    SECONDARY_COLLINEAR = 1, ///< too near the line through the primary: no turn about it
    SECONDARY_TRACKED = 2    ///< as intended
} SecondaryUse;

/** How the bodies stand for two-body pointing. r2 is pi/2 - separation away from the secondary. */
typedef struct TwoBodyStatus {
    Head head;
    double separation; ///< [rad] angle between the directions to the two bodies; 0 if one is absent
    SecondaryUse secondary;
    uint32_t spare;
} TwoBodyStatus;

#endif

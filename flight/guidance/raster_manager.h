/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_RASTER_MANAGER_H
#define FLIGHT_GUIDANCE_RASTER_MANAGER_H

#include "flight/msg/guidance.h"

/** Command a list of rasters to an Euler rotation, one after the other.
 *  Each is a set of 3-2-1 angles that change at constant rates for a while. After the last the list
 *  begins anew, or its end is held without rates.
 *  Each raster begins at the list's start plus the durations before it, in whole ns, and the command holds this time:
 *     start_k = start + sum over j < k of durations_j,   (psi, theta, phi) = angles_k + rates_k (t - start_k)
 *  So neither the rate of updates nor a command that is read late changes the
 *  pattern; but a raster shorter than the time between two updates may never be commanded.
 *  The parameters hold the first list, which starts at the first update after a reset, but not before 0. A list at the
 *  input replaces it when that list starts, and stays in effect until the next one starts.
 *  The module refuses a list without rasters or with too many, with a duration out of bounds or with
 *  a number that is not finite. If it refuses a list at the input, the list before stays in effect,
 *  degraded; if it refuses the parameters, it holds the last command, degraded.
 *  Source: thesis, chapter 2. */
typedef struct RasterManager {
    struct {
        RasterList list; ///< optional: replaces the parameters when it starts
    } in;
    struct {
        EulerCommand command;
        RasterStatus status;
    } out;
    struct {
        uint32_t n;                    ///< [-] in [1, 16]: number of rasters
        uint32_t repeat;               ///< [-] in [0, 1]: 1: begin anew; 0: hold the end
        Vec3 angles[RASTERS_MAX];      ///< [rad] count n: psi, theta, phi where each begins
        Vec3 rates[RASTERS_MAX];       ///< [rad/s] count n: their constant rates
        double durations[RASTERS_MAX]; ///< [s] required, count n, > 0, <= 5e8: how long each lasts,
                                       ///< to the nearest ns
    } par;
    struct {
        RasterList commanded; ///< the list in effect, if it came by the input
        int64_t start;        ///< [ns] when the list of the parameters began
        int32_t running;      ///< [-]  0 until the first update after a reset
        int32_t spare;
    } mem;
} RasterManager;

void raster_manager_reset(RasterManager *m);
void raster_manager_update(RasterManager *m, Tick t);

#endif

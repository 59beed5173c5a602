/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_STAR_TRACKER_ATTITUDE_H
#define FLIGHT_SENSING_STAR_TRACKER_ATTITUDE_H

#include "flight/msg/avionics.h"
#include "flight/msg/sensors.h"

/** The attitude from the registers of a star tracker, with the time of its measurement. Each measurement is given once.
 *  One is refused whose counts make no unit quaternion, that is older than age_max, or whose residual is above
 *  residual_max.
 *  The third axis of the tracker's case S is its boresight.
 *  Assumptions: its clock is that of the ticks; errors about the boresight are `about` times those across it. */
typedef struct StarTrackerAttitude {
    struct {
        StarTrackerRegisters registers;
    } in;
    struct {
        StarAttitude attitude;
        StarTrackerState state;
    } out;
    struct {
        uint32_t bits;         ///< [-] required, in [2, 32]: of a component of the quaternion, with its sign
        uint32_t residual_max; ///< [-] counts; 0: any
        Vec3 sigma_SB;         ///< [-] attitude of the case relative to B
        double residual;       ///< [rad] required, > 0, <= 1: of one count, also the least error across the boresight
        double about;          ///< [-] >= 0, <= 1e6: deviation about the boresight per that across it; 0: 1
        int64_t tick;          ///< [ns] required, in [1, 1000000000]: of the time tags
        int64_t age_max;       ///< [ns] >= 0: of a measurement; 0: any
    } par;
    struct {
        uint32_t counter; ///< [-] of the measurement that was read last
        uint32_t known;   ///< [-] 1: there is one
    } mem;
} StarTrackerAttitude;

void star_tracker_attitude_reset(StarTrackerAttitude *m);
void star_tracker_attitude_update(StarTrackerAttitude *m, Tick t);

#endif

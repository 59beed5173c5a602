/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_STAR_TRACKER_ELECTRONICS_H
#define WORLD_AVIONICS_STAR_TRACKER_ELECTRONICS_H

#include "flight/msg/avionics.h"
#include "flight/msg/sensors.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** The electronics of a star tracker: its measurements as integers, in the axes S of its case, whose third one is its
 *  boresight. A component of the quaternion has the count 2^(bits - 1) - 1 for 1. Without power its registers stand
 *  still.
 *  The channels of its faults are the four components of the quaternion, in counts.
 *  Let it run after its star tracker, in the same task.
 *  Source: thesis section 5.3.2. */
typedef struct StarTrackerElectronics {
    struct {
        StarAttitude attitude; ///< of the star tracker
        FaultSet injected;     ///< optional: faults, besides the planned ones
        LoadSupply power;      ///< optional: without it the electronics are on
    } in;
    struct {
        StarTrackerRegisters registers;
    } out;
    struct {
        uint32_t bits;      ///< [-] required, in [2, 32]: of a component, with its sign
        uint32_t load;      ///< [-] in [0, 31]: their load in the power unit
        Vec3 sigma_SB;      ///< [-] attitude of the case relative to B
        double residual;    ///< [rad] required, > 0, <= 1: of one count
        int64_t tick;       ///< [ns] required, in [1, 1000000000]: of the time tags
        int64_t lost_after; ///< [ns] >= 0: age of the last measurement at which it no longer tracks; 0: one second
        uint32_t n_faults;  ///< [-] in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        int64_t measured;  ///< [ns] time of the last measurement
        uint32_t sequence; ///< [-] of the star tracker's last message
        uint32_t spare2;
    } mem;
} StarTrackerElectronics;

#endif

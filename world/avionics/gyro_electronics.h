/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_GYRO_ELECTRONICS_H
#define WORLD_AVIONICS_GYRO_ELECTRONICS_H

#include "flight/msg/avionics.h"
#include "flight/msg/sensors.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** The electronics of gyros: they sum up the rate about each axis, and hold the angle in counts that wrap around. So no
 *  turn is lost between two readings. Without power their registers stand still; after it, angle and
 *  counter begin anew.
 *  The channels of their faults are the three counts, from 0 to 2^bits - 1.
 *  Let them run after their gyros, in the same task.
 *  Assumptions: a sample of the rate is the mean since the last one.
 *  Source: thesis section 5.3.2. */
typedef struct GyroElectronics {
    struct {
        GyroRate rate;     ///< of the gyros
        FaultSet injected; ///< optional: faults, besides the planned ones
        LoadSupply power;  ///< optional: without it the electronics are on
    } in;
    struct {
        GyroRegisters registers;
    } out;
    struct {
        uint32_t bits;     ///< [-] required, in [2, 32]: of a count
        uint32_t load;     ///< [-] in [0, 31]: their load in the power unit
        double scale;      ///< [rad] required, > 0, <= 1: angle of one count
        int64_t tick;      ///< [ns] required, in [1, 1000000000]: of the time tags
        uint32_t n_faults; ///< [-] in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        Vec3 turned;       ///< [rad] about each axis
        int64_t sampled;   ///< [ns] time of the last sample
        uint32_t sequence; ///< [-] of the gyros' last message
        uint32_t begun;    ///< [-] 1: there is a last sample
    } mem;
} GyroElectronics;

#endif

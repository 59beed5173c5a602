/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_SUN_SENSOR_CONVERTER_H
#define WORLD_AVIONICS_SUN_SENSOR_CONVERTER_H

#include "flight/msg/avionics.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** A converter of the currents of coarse sun sensors to counts: count = (current + noise - offset) / scale, to the
 *  nearest one, within its range.
 *  Two of them, each of a pyramid of four sensors, with scales and offsets of their own, serve a flight computer.
 *  Source: thesis sections 5.3.2 and 5.4.3. */
typedef struct SunSensorConverter {
    struct {
        SunCurrents currents;
        FaultSet injected; ///< optional: faults, besides the planned ones
        LoadSupply power;  ///< optional: without it the converter is on
    } in;
    struct {
        SunSensorCounts counts;
    } out;
    struct {
        uint32_t n;        ///< [-] required, in [1, 8]: number of channels
        uint32_t first;    ///< [-] in [0, 7]: the sensor that its first channel reads
        uint32_t bits;     ///< [-] required, in [1, 16]: of a count
        uint32_t n_faults; ///< [-] in [0, 4]: number of planned faults
        double scale;      ///< [A] required, > 0: of one count
        double offset;     ///< [A] of the count 0
        double noise;      ///< [A] >= 0: standard deviation of a reading
        uint32_t load;     ///< [-] in [0, 31]: the converter's load in the power unit
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned; the unit of a bias is a count
    } par;
} SunSensorConverter;

#endif

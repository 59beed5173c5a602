/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_SUN_SENSOR_CONVERTER_H
#define WORLD_AVIONICS_SUN_SENSOR_CONVERTER_H

#include "world/msg/sun.h"

/** What is wrong with a channel of a converter. */
typedef enum ChannelFault {
    CHANNEL_SOUND = 0,
    CHANNEL_HIGH = 1,   ///< it stays at its highest count
    CHANNEL_LOW = 2,    ///< it stays at 0
    CHANNEL_BABBLES = 3 ///< it gives any count
} ChannelFault;

/** A converter of the currents of coarse sun sensors to counts: count = (current + noise - offset) / scale, to the
 *  nearest one, within its range. Faults of channels begin and end at given times.
 *  Two of them, with scales and offsets of their own, make the redundant converters of a flight computer.
 *  Source: thesis sections 5.3.2 and 5.4.3. */
typedef struct SunSensorConverter {
    struct {
        SunCurrents currents;
    } in;
    struct {
        SunSensorCounts counts;
    } out;
    struct {
        uint32_t n;                          ///< [-] required, in [1, 8]: number of channels
        uint32_t bits;                       ///< [-] required, in [1, 16]: of a count
        double scale;                        ///< [A] required, > 0: of one count
        double offset;                       ///< [A] of the count 0
        double noise;                        ///< [A] >= 0: standard deviation of a reading
        int64_t fault_from;                  ///< [ns] >= 0: when the faults begin
        int64_t fault_until;                 ///< [ns] >= 0: when they end; 0: never
        ChannelFault fault[SUN_SENSORS_MAX]; ///< [-] of each channel
    } par;
} SunSensorConverter;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* What passes between flight and the avionics, in counts of converters where there is a converter: integers pass words
 * of any board without rounding. */
#ifndef FLIGHT_MSG_AVIONICS_H
#define FLIGHT_MSG_AVIONICS_H

#include "flight/msg/head.h"
#include "flight/msg/wheels.h"

#define SUN_SENSORS_MAX 8

/** What drives the motors of the wheels. */
typedef struct WheelDrive {
    Head head;
    int32_t counts[WHEELS_MAX]; ///< [-] of the converter from numbers to volts
} WheelDrive;

/** How far the wheels turned in the last whole window of time, relative to the body. */
typedef struct WheelTachometers {
    Head head;
    int32_t counts[WHEELS_MAX]; ///< [-] of the tachometer; their sign is that of the direction
} WheelTachometers;

/** What one converter makes of the currents of the coarse sun sensors. */
typedef struct SunSensorCounts {
    Head head;
    uint16_t counts[SUN_SENSORS_MAX]; ///< [-] of the converter
} SunSensorCounts;

#endif

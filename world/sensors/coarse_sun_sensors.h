/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_COARSE_SUN_SENSORS_H
#define WORLD_SENSORS_COARSE_SUN_SENSORS_H

#include "flight/msg/avionics.h"
#include "world/sensors/sun_sensor.h"

/** Coarse sun sensors: photodiodes whose current follows the cosine of the angle to the Sun, within a field of view.
 *  Assumptions: the Sun is a point of constant brightness and in sight, but for the
 *  eclipses of the sunlight that is wired; a planet disturbs them by as much as it reflects per light of the Sun, if
 *  Python's `radiation` is a PlanetRadiation. They do not see infrared. */
typedef struct CoarseSunSensors {
    SunSensorInputs in;
    struct {
        SunCurrents currents;
    } out;
    struct {
        uint32_t n;                      ///< [-] required, in [1, 8]: number of sensors
        uint32_t n_faults;               ///< [-] in [0, 4]: number of planned faults
        Vec3 axes_B[SUN_SENSORS_MAX];    ///< [-] required, count n, non-zero: where they look
        double current[SUN_SENSORS_MAX]; ///< [A] required, count n, > 0: of a sensor that faces the Sun
        double view[SUN_SENSORS_MAX];    ///< [rad] count n, in [0, 1.5707963267948966]: half the angle of its field of
                                         ///< view; 0: the whole hemisphere
        Vec3 s_N;                        ///< [-] direction to the Sun, if neither is wired
        Fault faults[FAULTS_MAX];        ///< count n_faults: planned; the channels are the sensors
    } par;
} CoarseSunSensors;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_SUN_SENSOR_H
#define WORLD_SENSORS_SUN_SENSOR_H

#include "flight/msg/orbit.h"
#include "flight/msg/sun.h"
#include "world/msg/craft.h"
#include "world/msg/environment.h"
#include "world/msg/fault.h"

/** The group `in` of sun sensors. */
typedef struct SunSensorInputs {
    CraftState truth;
    BodyState sun;      ///< optional: the Sun; without it, it is far away in the direction s_N
    Illumination light; ///< optional: how much of the Sun is visible, and where, if `sun` is not wired
    FaultSet injected;  ///< optional: faults, besides the planned ones
} SunSensorInputs;

/** A fine sun sensor: the direction to the Sun, where it is in the field of view and not in shadow; else it writes
 *  nothing. The variance of a reading, of an angle across the direction, is deviation^2 + noise / dt, with the time dt
 *  since the last update. A bias or a drift among its faults is a turn about a body axis; all others act on the
 *  components of the direction. A planet draws the direction towards the mean of all light in the field of view, by
 *  the share that the sensor does not reject, if Python's `radiation` is a PlanetRadiation. */
typedef struct SunSensor {
    SunSensorInputs in;
    struct {
        SunHeading heading;
    } out;
    struct {
        Vec3 boresight_B;   ///< [-]       required, non-zero: where it looks
        double view;        ///< [rad]     required, > 0, <= 3.1415926535897931: half the angle of its field of view
        double noise;       ///< [rad^2 s] >= 0: density of the noise
        double deviation;   ///< [rad]     >= 0, assumed: standard deviation of each reading besides
        Vec3 misalignment;  ///< [rad]     turn of the case that flight does not know, a rotation vector: a bias
        Vec3 s_N;           ///< [-]       direction to the Sun, if neither is wired
        double visible_min; ///< [-]       in [0, 1]: share of the Sun's disc that it needs
        double rejection;   ///< [-]       in [0, 1]: share of the planet's light that it rejects
        uint32_t n_faults;  ///< [-]       in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned; the channels are the axes
    } par;
} SunSensor;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_CRAFT_SENSOR_H
#define WORLD_SENSORS_CRAFT_SENSOR_H

#include "flight/msg/sensors.h"
#include "world/msg/craft.h"
#include "world/msg/fault.h"

/** A sensor of the position and attitude of another spacecraft T relative to its own B, a camera or a lidar. Where T is
 *  out of its field of view or of its range, it writes nothing.
 *  A position at the distance d has an error of the standard deviation range_noise + range_share d along the line of
 *  sight, and bearing_noise d across it. Errors of the attitude are turns about the axes of T.
 *  The channels of its faults: 0 to 2 position, 3 to 5 velocity, 6 to 8 attitude (a bias or drift is a turn about an
 *  axis of T, all else acts on the MRP), 9 to 11 rate.
 *  Assumptions: T is a point in the field of view, and hides behind nothing; all noise is white. */
typedef struct CraftSensor {
    struct {
        CraftState truth;  ///< of the spacecraft that carries it
        CraftState other;  ///< of the spacecraft that it looks at
        FaultSet injected; ///< optional: faults, besides the planned ones
    } in;
    struct {
        SeenCraft seen;
    } out;
    struct {
        Vec3 boresight_B;      ///< [-]     where it looks; zero: everywhere
        double view;           ///< [rad]   in [0, 3.1415926535897931]: half the angle of its field of view; 0: the
                               ///< whole hemisphere
        double range_max;      ///< [m]     >= 0, assumed: how far it sees; 0: any distance
        double range_noise;    ///< [m]     >= 0: standard deviation along the line of sight
        double range_share;    ///< [-]     >= 0: and per distance
        double bearing_noise;  ///< [rad]   >= 0: standard deviation of each angle across it
        double velocity_noise; ///< [m/s]   >= 0: standard deviation of each component
        double attitude_noise; ///< [rad]   >= 0: standard deviation about each axis
        double rate_noise;     ///< [rad/s] >= 0: standard deviation of each component
        uint32_t n_faults;     ///< [-]     in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
} CraftSensor;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_GPS_RECEIVER_H
#define WORLD_SENSORS_GPS_RECEIVER_H

#include "flight/msg/orbit.h"
#include "world/msg/craft.h"
#include "world/msg/fault.h"

/** A receiver of navigation satellites: position and velocity of its antenna relative to N, `latency` later, with their
 *  own time. The error of the position is white plus one that wanders, a Gauss-Markov process of first order
 *  (satellites' clocks and orbits, the ionosphere), with any period of updates; that of the velocity is white.
 *  Its acceleration is zero: not known.
 *  The channels of its faults: 0 to 2 position, 3 to 5 velocity.
 *  Assumptions: it always sees enough satellites; it knows N. */
typedef struct GpsReceiver {
    struct {
        CraftState truth;
        FaultSet injected; ///< optional: faults, besides the planned ones
    } in;
    struct {
        NavOrbit orbit;
    } out;
    struct {
        Vec3 r_AB_B;         ///< [m]   place of the antenna relative to the body's origin
        Vec3 position_noise; ///< [m]   >= 0, assumed: standard deviation of the white error of each reading, in N
        Vec3 velocity_noise; ///< [m/s] >= 0: standard deviation of the white error of each reading, in N
        Vec3 wander;         ///< [m]   >= 0: standard deviation of the error of the position that wanders, in N
        double wander_time;  ///< [s]   >= 0: its correlation time; 0: it is constant
        double latency;      ///< [s]   in [0, 1000000]: from the measurement to the message
        uint32_t n_faults;   ///< [-]   in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        Vec3 wandered;    ///< [m] the error that wanders, now
        uint32_t started; ///< [-] 1: it has been drawn
        uint32_t spare2;
    } mem;
} GpsReceiver;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_STAR_TRACKER_H
#define WORLD_SENSORS_STAR_TRACKER_H

#include "flight/msg/orbit.h"
#include "flight/msg/sensors.h"
#include "world/msg/craft.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** A star tracker: the attitude with noise about its boresight and across it, `latency` later, with its own time.
 *  The variance of a reading about an axis is deviation^2 + noise / dt, with the time dt since the last update. It is
 *  blind where a bright body stands too near to its boresight, where the body turns too fast, and at random: losses
 *  begin as a Poisson process does, and last for exponentially distributed times.
 *  A blind or silent tracker writes nothing.
 *  A bias or a drift among its faults is a turn about a body axis; all others act on the MRP.
 *  Assumptions: an exposure is an instant; a body that another one hides blinds it all the same. */
typedef struct StarTracker {
    struct {
        CraftState truth;
        BodyState sun;     ///< optional: the Sun; without it, it is far away in the direction s_N
        BodyState planet;  ///< optional: without it, it is at the origin of N
        BodyState moon;    ///< optional: a moon; moon_exclusion needs it
        FaultSet injected; ///< optional: faults, besides the planned ones
        LoadSupply power;  ///< optional: without it the tracker is on
    } in;
    struct {
        StarAttitude attitude;
    } out;
    struct {
        Vec3 boresight_B;         ///< [-]       required, non-zero: where it looks
        double noise_across;      ///< [rad^2 s] >= 0, assumed: density of the noise, about an axis across the boresight
        double noise_about;       ///< [rad^2 s] >= 0: and about the boresight
        double deviation_across;  ///< [rad]     >= 0: standard deviation of each reading besides
        double deviation_about;   ///< [rad]     >= 0: and about the boresight
        Vec3 misalignment;        ///< [rad]     turn of the case that flight does not know, a rotation vector: a bias
        Vec3 s_N;                 ///< [-]       direction to the Sun, if it is not wired
        double sun_exclusion;     ///< [rad]     in [0, 3.1], assumed: least angle to the Sun's centre; 0: none
        double planet_exclusion;  ///< [rad]     in [0, 3.1], assumed: least angle to the limb of the planet; 0: none
        double planet_radius;     ///< [m]       >= 0: of the planet
        double moon_exclusion;    ///< [rad]     in [0, 3.1]: least angle to the limb of the moon; 0: none
        double moon_radius;       ///< [m]       >= 0: of the moon
        double rate_max;          ///< [rad/s]   >= 0, assumed: fastest rate at which it measures; 0: any
        double loss_rate;         ///< [1/s]     >= 0: random losses in a time; 0: none
        double loss_time;         ///< [s]       >= 0: mean duration of a loss; 0: one update
        double latency;           ///< [s]       in [0, 1000000]: from the measurement to the message
        uint32_t n_faults;        ///< [-]       in [0, 4]: number of planned faults
        uint32_t load;            ///< [-]       in [0, 31]: the tracker's load in the power unit
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned; the channels are the axes
    } par;
    struct {
        uint32_t blind; ///< [-] by what it is blind now, a bit for each: Sun, planet, moon, rate, random loss
        uint32_t lost;  ///< [-] 1: during a random loss
    } mem;
} StarTracker;

#endif

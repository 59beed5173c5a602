/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_GYRO_H
#define WORLD_SENSORS_GYRO_H

#include "flight/msg/sensors.h"
#include "world/msg/craft.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** Three gyros at right angles: the angular rate with the errors of world/sensors/triad.h.
 *  The densities are the squares of what data sheets give: an angle random walk of 0.15 deg/sqrt(h) is
 *  (0.15 * deg)**2 / hour, a rate random walk of 0.3 deg/h/sqrt(h) is (0.3 * deg / hour)**2 / hour.
 *  Assumptions: it samples the rate at its updates; the first reading after a reset has no noise of a density. */
typedef struct Gyro {
    struct {
        CraftState truth;
        FaultSet injected; ///< optional: faults, besides the planned ones
        LoadSupply power;  ///< optional: without it the gyro is on
    } in;
    struct {
        GyroRate rate;
    } out;
    struct {
        Vec3 noise;               ///< [rad^2/s]   >= 0, assumed: density of the white noise
        Vec3 walk;                ///< [rad^2/s^3] >= 0: density of the white noise whose integral the bias is
        Vec3 bias;                ///< [rad/s]     the bias at the beginning
        Vec3 scale;               ///< [-]         relative errors of the scale factors
        Vec3 misalignment;        ///< [rad]       turn of the case, a rotation vector
        double step;              ///< [rad/s]     >= 0: of the quantisation; 0: none
        double limit;             ///< [rad/s]     >= 0, assumed: at which it saturates; 0: none
        uint32_t n_faults;        ///< [-]         in [0, 4]: number of planned faults
        uint32_t load;            ///< [-]         in [0, 31]: the gyro's load in the power unit
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned; the channels are the axes
    } par;
    struct {
        Vec3 walked;        ///< [rad/s] what the bias has become more by its walk
        uint64_t saturated; ///< [-] updates in which the limit cut a reading
    } mem;
} Gyro;

#endif

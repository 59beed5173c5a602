/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_ACCELEROMETER_H
#define WORLD_SENSORS_ACCELEROMETER_H

#include "flight/msg/sensors.h"
#include "world/msg/craft.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** Three accelerometers at right angles, at a place of the body: the acceleration of that place less gravity, with the
 *  errors of world/sensors/triad.h. With the place r relative to the body's origin B,
 *  f = [BN](a_BN - g) + domega x r + omega x (omega x r).
 *  The densities are the squares of what data sheets give: a velocity random walk of 0.1 m/s/sqrt(h) is
 *  (0.1 * m / s)**2 / hour.
 *  It counts pulses of velocity: a reading is the mean since the last update, of which nothing is lost, and their sum.
 *  A step in which it is silent is not counted.
 *  Assumptions: from one update to the next the body turns by a small angle, and gravity, that at the centre of mass,
 *  changes evenly; the first reading after a reset is that of the instant, without noise of a density, and does not
 *  count. */
typedef struct Accelerometer {
    struct {
        CraftState truth;
        FaultSet injected; ///< optional: faults, besides the planned ones
        LoadSupply power;  ///< optional: without it the sensor is on
    } in;
    struct {
        SpecificForce force;
    } out;
    struct {
        Vec3 r_AB_B;              ///< [m]       its place relative to the body's origin
        Vec3 noise;               ///< [m^2/s^3] >= 0, assumed: density of the white noise
        Vec3 walk;                ///< [m^2/s^5] >= 0: density of the white noise whose integral the bias is
        Vec3 bias;                ///< [m/s^2]   the bias at the beginning
        Vec3 scale;               ///< [-]       relative errors of the scale factors
        Vec3 misalignment;        ///< [rad]     turn of the case, a rotation vector
        double step;              ///< [m/s^2]   >= 0: of the quantisation; 0: none
        double limit;             ///< [m/s^2]   >= 0, assumed: at which it saturates; 0: none
        uint32_t n_faults;        ///< [-]       in [0, 4]: number of planned faults
        uint32_t load;            ///< [-]       in [0, 31]: the sensor's load in the power unit
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned; the channels are the axes
    } par;
    struct {
        CraftState before;  ///< at the last update
        Vec3 walked;        ///< [m/s^2] what the bias has become more by its walk
        uint64_t saturated; ///< [-] updates in which the limit cut a reading
    } mem;
} Accelerometer;

#endif

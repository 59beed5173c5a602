/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_MAGNETOMETER_H
#define WORLD_SENSORS_MAGNETOMETER_H

#include "flight/msg/magnetics.h"
#include "world/msg/craft.h"
#include "world/msg/environment.h"
#include "world/msg/fault.h"

/** Three magnetometers at right angles: the magnetic field with the errors of world/sensors/triad.h.
 *  The densities are the squares of what data sheets give: 0.1 nT/sqrt(Hz) is (0.1 * nT)**2 / Hz.
 *  Assumptions: the field of torque rods does not reach it; what else the craft adds is constant. */
typedef struct Magnetometer {
    struct {
        CraftState truth;
        MagneticField field;
        FaultSet injected; ///< optional: faults, besides the planned ones
    } in;
    struct {
        MeasuredField measured;
    } out;
    struct {
        Vec3 residual_B;   ///< [T]     field of the craft itself
        Vec3 noise;        ///< [T^2 s] >= 0, assumed: density of the white noise
        Vec3 walk;         ///< [T^2/s] >= 0: density of the white noise whose integral the bias is
        Vec3 bias;         ///< [T]     the bias at the beginning
        Vec3 scale;        ///< [-]     relative errors of the scale factors
        Vec3 misalignment; ///< [rad]   turn of the case, a rotation vector
        double step;       ///< [T]     >= 0: of the quantisation; 0: none
        double limit;      ///< [T]     >= 0, assumed: at which it saturates; 0: none
        uint32_t n_faults; ///< [-]     in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned; the channels are the axes
    } par;
    struct {
        Vec3 walked;        ///< [T] what the bias has become more by its walk
        uint64_t saturated; ///< [-] updates in which the limit cut a reading
    } mem;
} Magnetometer;

#endif

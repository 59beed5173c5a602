/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ACTUATORS_TORQUE_RODS_H
#define WORLD_ACTUATORS_TORQUE_RODS_H

#include "flight/msg/magnetics.h"
#include "flight/msg/vehicle.h"
#include "world/msg/fault.h"

/** Magnetic torque rods, a part of a spacecraft: the torque m x B of their dipoles. Python's `field` is the model of
 *  the magnetic field. They act at each stage of the integrator, in the field where the craft is then. The channels of
 *  their faults are the dipoles.
 *  Assumptions: a dipole follows its command at once; no remanence, no effect of one rod on another. */
typedef struct TorqueRods {
    struct {
        RodCommand command; ///< optional: dipoles; without it the rods are off
        FaultSet injected;  ///< optional: faults, besides the planned ones
    } in;
    struct {
        RodCommand applied; ///< dipoles after limits and faults
        BodyTorque torque;  ///< on the spacecraft
    } out;
    struct {
        uint32_t n;               ///< [-] required, in [1, 8]: number of rods
        uint32_t n_faults;        ///< [-] in [0, 4]: number of planned faults
        Vec3 axes_B[RODS_MAX];    ///< [-] required, count n, non-zero: directions of positive dipoles
        double m_max[RODS_MAX];   ///< [A m^2] count n, in [0, 1e9]: largest dipole; 0: unlimited
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        uint64_t saturated; ///< [-] updates in which a rod had less than its commanded dipole
    } mem;
} TorqueRods;

#endif

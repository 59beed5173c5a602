/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_ARRAY_DRIVE_H
#define WORLD_AVIONICS_ARRAY_DRIVE_H

#include "flight/msg/avionics.h"
#include "flight/msg/panels.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** Stepper motors that turn solar arrays: each goes to its target by whole steps, as fast as its rate allows, and holds
 *  its position without power. `panels` turns the rest of the springs of world.HingedPanels, which are the gears'
 *  stiffness; `angles` turns panels of world.SolarArray that have no dynamics.
 *  The channels of its faults are the drives; each turns where its channel, which is 1, is at least 0.5, so that DEAD
 *  and LOW stop it.
 *  Assumptions: no step is lost; the angle's sensor is exact but for its count. */
typedef struct ArrayDrive {
    struct {
        ArrayDriveCommand command; ///< optional: without it the arrays stay where they are
        FaultSet injected;         ///< optional: faults, besides the planned ones
        LoadSupply power;          ///< optional: without it the drives are on
    } in;
    struct {
        PanelCommand panels;
        PanelAngles angles;
        ArrayDriveState state;
    } out;
    struct {
        uint32_t n;               ///< [-] required, in [1, 4]: number of arrays
        uint32_t load;            ///< [-] in [0, 31]: the drives' load in the power unit
        double step;              ///< [rad] required, in [1e-6, 1]: of one step
        double rate;              ///< [1/s] required, > 0, <= 1e6: steps per second
        double count;             ///< [rad] required, in [1e-9, 1]: of one count of the angle's sensor
        int32_t range;            ///< [-] >= 0: steps to the stop at either side; 0: it turns without end
        uint32_t n_faults;        ///< [-] in [0, 4]: number of planned faults
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        int32_t steps[ARRAYS_MAX]; ///< [-] position of each
        double due[ARRAYS_MAX];    ///< [-] part of the next step that has passed
    } mem;
} ArrayDrive;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_SENSORS_FAULT_PANEL_H
#define WORLD_SENSORS_FAULT_PANEL_H

#include "world/msg/fault.h"

/** Faults as a message: those of its parameters. Wired to the `injected` of a sensor or an actuator, it changes the
 *  faults during a run, by an event or between runs. In a process of its own it holds the place of another program of
 *  a co-simulation, which writes the message instead. */
typedef struct FaultPanel {
    struct {
        FaultSet set;
    } out;
    struct {
        uint32_t n_faults; ///< [-] in [0, 4]: number of faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: which
    } par;
} FaultPanel;

#endif

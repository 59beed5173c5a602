/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_THRUSTER_FIRING_H
#define FLIGHT_ACTUATION_THRUSTER_FIRING_H

#include "flight/msg/thrusters.h"

/** Open each thruster for as long as gives its wanted force on average over a period: F / F_max of it.
 *  A time below `min_on` is decided by a Schmitt trigger: the thruster opens for `min_on` where the time is at least
 *  `level_on` of it, stays shut where it is at most `level_off`, and in between does what it did last. Times of a
 *  period and more leave it open without a gap. Each command ends with the next, or by itself after a period; without
 *  new forces, or where one of them is not finite, no thruster opens, degraded.
 *  Source: Wie 2008, section 7.5, for pulse modulation with a Schmitt trigger. */
typedef struct ThrusterFiring {
    struct {
        ThrusterForces forces;
        ThrusterSet thrusters;
    } in;
    struct {
        ThrusterTimes times;
    } out;
    struct {
        double period;    ///< [s] required, in [1e-3, 1000]: of the control, that of the module's task
        double min_on;    ///< [s] in [0, 1000]: shortest time for which a thruster opens
        double level_on;  ///< [-] required, in [0, 1]: part of min_on from which it opens
        double level_off; ///< [-] in [0, 1]: part of min_on up to which it stays shut, below level_on
    } par;
    struct {
        uint32_t opened; ///< [-] thrusters that the last update opened, a bit for each
        uint32_t spare;
    } mem;
} ThrusterFiring;

void thruster_firing_reset(ThrusterFiring *m);
void thruster_firing_update(ThrusterFiring *m, Tick t);

#endif

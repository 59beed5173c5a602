/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_THRUSTER_CONFIG_H
#define FLIGHT_VEHICLE_THRUSTER_CONFIG_H

#include "flight/msg/thrusters.h"

/** Publishes the vehicle's thrusters to the modules that need them, with unit directions and arms about the centre of
 *  mass. A direction of zero, and more thrusters than there is room for, make the message degraded. */
typedef struct ThrusterConfig {
    struct {
        ThrusterSet thrusters;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 8]: number of thrusters
        uint32_t spare;
        Vec3 r_CB_B;                 ///< [m] centre of mass, relative to B, B components
        Vec3 r_TB_B[THRUSTERS_MAX];  ///< [m] required, count n: where each acts, relative to B
        Vec3 axes_B[THRUSTERS_MAX];  ///< [-] required, count n, non-zero: direction of its force on the body
        double F_max[THRUSTERS_MAX]; ///< [N] required, count n, > 0: its force while it is open
    } par;
} ThrusterConfig;

void thruster_config_reset(ThrusterConfig *m);
void thruster_config_update(ThrusterConfig *m, Tick t);

#endif

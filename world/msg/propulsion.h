/* SPDX-License-Identifier: Apache-2.0 */
/* What thrusters and tanks do. */
#ifndef WORLD_MSG_PROPULSION_H
#define WORLD_MSG_PROPULSION_H

#include "flight/msg/avionics.h"

#define TANKS_MAX 4

/** What thrusters give. Degraded once their tanks are empty. */
typedef struct ThrusterOutput {
    Head head;
    double thrust[THRUSTERS_MAX];  ///< [N]    of each thruster
    double impulse[THRUSTERS_MAX]; ///< [N s]  since the reset
    double flow;                   ///< [kg/s] of propellant through all thrusters
    double used;                   ///< [kg]   propellant since the reset
} ThrusterOutput;

/** What is in the tanks. Degraded once they are empty. */
typedef struct TankLevels {
    Head head;
    double mass[TANKS_MAX]; ///< [kg] propellant in each tank
} TankLevels;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_GRAVITY_GRADIENT_H
#define WORLD_DYNAMICS_GRAVITY_GRADIENT_H

#include "world/msg/craft.h"

/** The torque by which gravity turns a spacecraft, a part of it: of all bodies in the spacecraft's `gravity`, at each
 *  stage of the integrator. It turns the body by the inertia of the whole about its centre of mass: wheels, tanks,
 *  panels and pendulums count, where they are at that stage. Panels and propellant feel it along their coordinates.
 *  Assumptions: the bodies attract as points (oblateness changes the torque by about 0.5 % in low orbits of the Earth);
 *  an imbalance does not change how a wheel spins.
 *  Source: Schaub and Junkins, section 4.4. */
typedef struct GravityGradient {
    struct {
        ForceTorque load; ///< the torque
    } out;
} GravityGradient;

#endif

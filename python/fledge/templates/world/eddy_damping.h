/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_EDDY_DAMPING_H
#define WORLD_EDDY_DAMPING_H

#include "world/msg/craft.h"

/** A torque against the body's rotation, with noise. Replace this example: describe the model, its
 *  assumptions and the source of its equations. The rules are those of flight modules; the class in
 *  eddy_damping_model.h has the behaviour. */
typedef struct EddyDamping {
    struct {
        CraftState truth;
    } in;
    struct {
        ForceTorque load; ///< for the spacecraft's input `external`
    } out;
    struct {
        double damping; ///< [N m s] >= 0, assumed: torque per angular rate
        double noise;   ///< [N m]   >= 0: standard deviation on each axis
    } par;
} EddyDamping;

#endif

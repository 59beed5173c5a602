/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_EXTERNAL_FORCE_H
#define WORLD_DYNAMICS_EXTERNAL_FORCE_H

#include "world/msg/craft.h"

/** One more force and torque on a spacecraft: a part for each output that acts on it. All add up.
 *  Assumptions: as for Spacecraft.external, a message acts until the next one. */
typedef struct ExternalForce {
    struct {
        ForceTorque external; ///< optional: what acts; without it nothing does
    } in;
} ExternalForce;

#endif

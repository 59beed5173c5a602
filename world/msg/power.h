/* SPDX-License-Identifier: Apache-2.0 */
/* Electrical power on board. */
#ifndef WORLD_MSG_POWER_H
#define WORLD_MSG_POWER_H

#include "flight/msg/head.h"

/** What solar panels give. */
typedef struct ArrayPower {
    Head head;
    double power; ///< [W] electrical
} ArrayPower;

/** Which loads of the power unit have power: switched on, by a card that works, at a bus that has a voltage. */
typedef struct LoadSupply {
    Head head;
    uint32_t on; ///< [-] a bit for each load
    uint32_t spare;
} LoadSupply;

/** Whether a unit behind a load has power; where no supply is wired, it has. */
static inline int supplied(const LoadSupply *supply, uint32_t load)
{
    return !head_written(supply->head) || (supply->on >> load & 1u);
}

#endif

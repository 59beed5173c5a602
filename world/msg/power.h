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

#endif

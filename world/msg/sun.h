/* SPDX-License-Identifier: Apache-2.0 */
/* What sensors of the Sun give. */
#ifndef WORLD_MSG_SUN_H
#define WORLD_MSG_SUN_H

#include "flight/msg/avionics.h"

/** The currents of coarse sun sensors. */
typedef struct SunCurrents {
    Head head;
    double current[SUN_SENSORS_MAX]; ///< [A] of each sensor
} SunCurrents;

#endif

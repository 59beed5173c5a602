/* SPDX-License-Identifier: Apache-2.0 */
/* Where sloshing fuel is. */
#ifndef WORLD_MSG_SLOSH_H
#define WORLD_MSG_SLOSH_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

#define SLOSH_MAX 8

/** The masses that stand for sloshing fuel. */
typedef struct SloshState {
    Head head;
    Vec3 r_B[SLOSH_MAX]; ///< [m]   positions relative to the body's origin, B components
    Vec3 v_B[SLOSH_MAX]; ///< [m/s] their rates, as B sees them
} SloshState;

#endif

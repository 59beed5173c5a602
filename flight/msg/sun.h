/* SPDX-License-Identifier: Apache-2.0 */
/* The Sun, as flight sees it. */
#ifndef FLIGHT_MSG_SUN_H
#define FLIGHT_MSG_SUN_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** A direction to the Sun. */
typedef struct SunHeading {
    Head head;
    Vec3 s_B; ///< [-] unit vector, B components
} SunHeading;

#endif

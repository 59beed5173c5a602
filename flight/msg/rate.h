/* SPDX-License-Identifier: Apache-2.0 */
/* Rates that an outer loop wants of an inner one. */
#ifndef FLIGHT_MSG_RATE_H
#define FLIGHT_MSG_RATE_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** How fast the body shall turn relative to its reference: the rate of a wanted frame D relative to R. */
typedef struct RateCommand {
    Head head;
    Vec3 omega_DR_B;  ///< [rad/s]   angular rate of D relative to R, B components
    Vec3 domega_DR_B; ///< [rad/s^2] its derivative in B
} RateCommand;

#endif

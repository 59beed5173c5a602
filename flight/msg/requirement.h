/* SPDX-License-Identifier: Apache-2.0 */
/* What flight says of its requirements. */
#ifndef FLIGHT_MSG_REQUIREMENT_H
#define FLIGHT_MSG_REQUIREMENT_H

#include "flight/msg/head.h"

enum { REQUIREMENTS = 8 };

/** The verdicts on the requirements that fly. Bit i of a set is that of requirement i. A margin is known to lie from
 *  low to high: above 0 the requirement holds, whatever comes, and below it is violated. The largest number of either
 *  sign stands for an infinite one: nothing is known, or only true and false count. */
typedef struct RequirementState {
    Head head;
    double low[REQUIREMENTS];      ///< [SI] of the margin
    double high[REQUIREMENTS];     ///< [SI] of the margin
    int64_t sampled[REQUIREMENTS]; ///< [ns] the instant up to which this is so; -1: no sample yet
    uint32_t on;                   ///< [-] those that are judged
    uint32_t holding;              ///< [-] those that hold
    uint32_t violated;             ///< [-] those that are violated
    uint32_t bad;                  ///< [-] those whose formula cannot be evaluated
} RequirementState;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* What protections report. */
#ifndef FLIGHT_MSG_PROTECTION_H
#define FLIGHT_MSG_PROTECTION_H

#include "flight/msg/head.h"

/** Where a protection stands. */
typedef struct ProtectionState {
    Head head;
    double value;     ///< [-] what is watched, as a part of its limit: above 1 it is beyond
    uint32_t tripped; ///< [-] in [0, 1]: 1: the limit was exceeded for long enough
    uint32_t count;   ///< [-] updates in a row beyond the limit
    uint32_t trips;   ///< [-] how often it has tripped since the reset
    uint32_t unknown; ///< [-] updates since the reset in which there was nothing to judge
} ProtectionState;

/** What a protection remembers. */
typedef struct Judgement {
    int64_t last;    ///< [ns] time of the data that were judged last
    uint32_t within; ///< [-] updates in a row within the limits
    uint32_t any;    ///< [-] 1 once there were data
} Judgement;

#endif

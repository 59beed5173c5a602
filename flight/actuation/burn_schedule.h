/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_BURN_SCHEDULE_H
#define FLIGHT_ACTUATION_BURN_SCHEDULE_H

#include "flight/msg/avionics.h"

#define BURNS_MAX 16

/** Open thrusters at the times of a list, and say so `ahead`: their card then burns though the computer is down. Of
 *  each thruster, an update gives the burn that is under way or next. After a reset of the module, burns whose start
 *  has passed are not given again.
 *  Assumptions: of one thruster, the next burn starts an update after the end of the last one, or later. */
typedef struct BurnSchedule {
    struct {
        ThrusterTimes times;
    } out;
    struct {
        uint32_t n; ///< [-] in [0, 16]: number of burns
        uint32_t spare;
        int64_t ahead;                ///< [ns] >= 0: how long before its start a burn is given
        double start[BURNS_MAX];      ///< [s] count n, >= 0, <= 5e8: of flight's time, rising
        double duration[BURNS_MAX];   ///< [s] count n, > 0, <= 5e8: of each burn, to the nearest ns
        uint32_t thruster[BURNS_MAX]; ///< [-] count n, in [0, 7]: which
    } par;
    struct {
        int64_t begun; ///< [ns] the module's first update
    } mem;
} BurnSchedule;

void burn_schedule_reset(BurnSchedule *m);
void burn_schedule_update(BurnSchedule *m, Tick t);

#endif

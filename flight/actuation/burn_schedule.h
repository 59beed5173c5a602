/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_BURN_SCHEDULE_H
#define FLIGHT_ACTUATION_BURN_SCHEDULE_H

#include "flight/msg/avionics.h"

#define BURNS_MAX 16

/** Give the burns of a list to the propulsion card, one after the other, each `ahead` of its start. The next one waits
 *  until the card has taken the last. Disarmed, it gives none. After a reset of the module, burns whose start has
 *  passed are not given again. */
typedef struct BurnSchedule {
    struct {
        PropulsionState card;
    } in;
    struct {
        BurnCommand burn;
    } out;
    struct {
        uint32_t n;                   ///< [-] in [0, 16]: number of burns
        uint32_t armed;               ///< [-] in [0, 1]: 1: the card shall burn
        int64_t ahead;                ///< [ns] >= 0: how long before its start a burn is given
        double start[BURNS_MAX];      ///< [s] count n, >= 0, <= 5e8: of flight's time, rising
        double duration[BURNS_MAX];   ///< [s] count n, > 0, <= 5e8: of each burn, to the nearest ns
        uint32_t thruster[BURNS_MAX]; ///< [-] count n, in [0, 7]: which
    } par;
    struct {
        uint32_t next;  ///< [-] the burn to be given
        uint32_t begun; ///< [-] 1: burns of before this start are left out
    } mem;
} BurnSchedule;

void burn_schedule_reset(BurnSchedule *m);
void burn_schedule_update(BurnSchedule *m, Tick t);

#endif

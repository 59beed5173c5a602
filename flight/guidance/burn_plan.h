/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_BURN_PLAN_H
#define FLIGHT_GUIDANCE_BURN_PLAN_H

#include "flight/msg/burn.h"

#define PLANNED_BURNS_MAX 8

/** Give the burns of a list, one after the other, to BurnPointing and BurnExecution: the next one when the last is
 *  complete. An aborted burn ends the plan until a reset, and so do numbers that are not finite; the command then keeps
 *  the last burn, which is not flown twice. After a reset the plan goes on with the burn that BurnMemory says has
 *  begun, if it is of the list, once that knows. */
typedef struct BurnPlan {
    struct {
        BurnState state; ///< of the execution
        BurnState kept;  ///< optional: of BurnMemory
    } in;
    struct {
        DeltaVCommand command;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 8]: number of burns
        uint32_t spare;
        double start[PLANNED_BURNS_MAX]; ///< [s] required, count n, >= 0, <= 5e8: when each begins, rising
        Vec3 dv_N[PLANNED_BURNS_MAX];    ///< [m/s] required, count n, non-zero: of each, N components
        Vec3 rate_N[PLANNED_BURNS_MAX];  ///< [rad/s] count n: at which the direction of each turns, N components
    } par;
    struct {
        uint32_t next;  ///< [-] the burn that is commanded
        uint32_t ended; ///< [-] 1: a burn was aborted
    } mem;
} BurnPlan;

void burn_plan_reset(BurnPlan *m);
void burn_plan_update(BurnPlan *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* How a message ages on its wire, and which of several an input takes. */
#ifndef FLIGHT_EXEC_MESSAGE_H
#define FLIGHT_EXEC_MESSAGE_H

#include "flight/msg/head.h"

/** Lower the quality of a message that at t is older than its wire allows. */
static inline void exec_age(Head *head, int64_t t, int64_t stale_after)
{
    if (tick_since(t, head->t) > stale_after && head->quality > QUALITY_STALE) {
        head->quality = QUALITY_STALE;
    }
}

/** Which message an input takes that has wires from several outputs. The first wire is carried; each further one, in
 *  their order, if it is better than what the input then holds. So the rule has no memory. */
typedef enum ExecChoice {
    EXEC_SOLE = 0,   ///< the input has one wire
    EXEC_NEWEST = 1, ///< the latest time; of equal ones the first
    EXEC_FIRST = 2,  ///< the first that is degraded or good; if none is, as EXEC_BEST
    EXEC_BEST = 3,   ///< the highest quality; of equal ones the first
    EXEC_IN_MODE = 4 ///< that of the mode in force; in other modes, the input keeps what it holds
} ExecChoice;

/** Whether an input that holds a message with the head `held`, which has aged, takes `next` at t; not of EXEC_IN_MODE.
 *  stale_after: [ns] of the wire; 0: never. */
static inline int exec_takes(ExecChoice by, Head held, Head next, int64_t t, int64_t stale_after)
{
    if (stale_after > 0) {
        exec_age(&next, t, stale_after);
    }
    switch (by) {
    case EXEC_NEWEST: return head_written(next) && (!head_written(held) || next.t > held.t);
    case EXEC_FIRST: return held.quality < QUALITY_DEGRADED && next.quality > held.quality;
    case EXEC_BEST: return next.quality > held.quality;
    default: return 1;
    }
}

#endif

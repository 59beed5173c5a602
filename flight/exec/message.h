/* SPDX-License-Identifier: Apache-2.0 */
/* How a message ages on its wire. */
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

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* When an event fires, and the measures of a vector that its condition may compare. */
#ifndef FLIGHT_EXEC_EVENT_H
#define FLIGHT_EXEC_EVENT_H

#include "flight/math/elementary.h"

#include <stddef.h>
#include <stdint.h>

/** An event fires when its condition has held for a time. It is then disarmed, and armed again as soon
 *  as the condition does not hold, unless it fires only once. */
typedef struct ExecEvent {
    int64_t since;    ///< [ns] when the condition began to hold; -1: it does not hold
    int64_t fired_at; ///< [ns] when the event last fired; -1: never
    int32_t armed;    ///< [-]  1 if it may fire
    int32_t spare;
} ExecEvent;

/** An event that has not fired yet. */
static inline ExecEvent exec_armed(void)
{
    return (ExecEvent){-1, -1, 1, 0};
}

/** Update an event at t, where its condition holds or does not. Returns 1 if the event fires. */
static inline int exec_fires(ExecEvent *event, int holds, int64_t hold, int once, int64_t t)
{
    if (!holds) {
        event->since = -1;
        event->armed = event->armed || !once;
        return 0;
    }
    if (event->since < 0) {
        event->since = t;
    }
    if (!event->armed || t - event->since < hold) {
        return 0;
    }
    event->armed = 0;
    event->fired_at = t;
    return 1;
}

/** The root of the sum of the squares of n numbers. */
static inline double exec_norm(const double *x, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) {
        sum += x[i] * x[i];
    }
    return fm_sqrt(sum);
}

/** The largest magnitude of n numbers. NaN does not count. */
static inline double exec_max_abs(const double *x, size_t n)
{
    double largest = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double magnitude = x[i] < 0.0 ? -x[i] : x[i];
        largest = magnitude > largest ? magnitude : largest;
    }
    return largest;
}

#endif

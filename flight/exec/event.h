/* SPDX-License-Identifier: Apache-2.0 */
/* When an event fires, and the measures of a vector that its condition may compare. */
#ifndef FLIGHT_EXEC_EVENT_H
#define FLIGHT_EXEC_EVENT_H

#include "flight/exec/element.h"
#include "flight/math/elementary.h"

#include <stddef.h>
#include <stdint.h>

/** An event fires when its condition has held for a time, and at a number of successive instants. It then waits until
 *  it may fire again: until the condition no longer holds, or until another one does. */
typedef struct ExecEvent {
    int64_t since;    ///< [ns] when the condition began to hold; -1: it does not hold
    int64_t fired_at; ///< [ns] when the event last fired; -1: never
    int32_t armed;    ///< [-]  1: it may fire; 0: not before something arms it; -1: it has fired and arms itself again
    int32_t held;     ///< [-]  at how many successive instants the condition has held
    int32_t refused;  ///< [-]  1: when it last fired, the condition of the mode that it enters did not hold
    int32_t spare;
} ExecEvent;

/** An event that has not fired yet. */
static inline ExecEvent exec_armed(void)
{
    return (ExecEvent){-1, -1, 1, 0, 0, 0};
}

/** One that does not fire before something arms it. */
static inline ExecEvent exec_disarmed(void)
{
    return (ExecEvent){-1, -1, 0, 0, 0, 0};
}

/** Update an event at an instant t. Returns 1 if the event fires.
 *  holds: whether its condition does; again: whether one that has fired is armed again; hold: [ns] and count: how long
 *  and at how many instants the condition must hold; once: whether it stays disarmed after it has fired. */
static inline int exec_fires(ExecEvent *event, int holds, int again, int64_t hold, int32_t count, int once, int64_t t)
{
    const int starts = event->armed < 0 && again;
    if (starts) {
        event->armed = 1;
    }
    if (starts || !holds || event->armed == 0) {
        event->since = -1;
        event->held = 0;
        return 0;
    }
    if (event->since < 0) {
        event->since = t;
    }
    if (event->held < INT32_MAX) {
        event->held++;
    }
    if (event->armed < 0 || t - event->since < hold || event->held < count) {
        return 0;
    }
    event->armed = once ? 0 : -1;
    event->fired_at = t;
    event->refused = 0;
    return 1;
}

/** A number of any type, exactly: the sum of two doubles. */
typedef struct ExecNumber {
    double high, low;
} ExecNumber;

static inline ExecNumber exec_real(double x)
{
    return (ExecNumber){x, 0.0};
}

static inline ExecNumber exec_signed(int64_t x)
{
    const int64_t high = x / 4294967296;
    return (ExecNumber){(double)high * 4294967296.0, (double)(x % 4294967296)};
}

static inline ExecNumber exec_unsigned(uint64_t x)
{
    const uint64_t high = x / 4294967296u;
    return (ExecNumber){(double)high * 4294967296.0, (double)(x % 4294967296u)};
}

/** A number with the sign of a - b, and 0 only if they are equal. One of them at least is a whole number. */
static inline double exec_difference(ExecNumber a, ExecNumber b)
{
    return (a.high - b.high) + (a.low - b.low);
}

/** One number of a vector, which a condition may compare. */
typedef enum ExecMeasure {
    EXEC_ELEMENT, ///< the first
    EXEC_NORM,    ///< the root of the sum of the squares
    EXEC_MAX_ABS  ///< the largest magnitude. NaN does not count
} ExecMeasure;

/** A measure of n numbers of a type, in a row. */
static inline double exec_measured(ExecMeasure measure, FledgeType type, const void *numbers, size_t n)
{
    const uint8_t *p = (const uint8_t *)numbers;
    if (measure == EXEC_ELEMENT) {
        return element_read(type, p);
    }
    double sum = 0.0, largest = 0.0;
    for (size_t i = 0; i < n; i++, p += element_size(type)) {
        const double x = element_read(type, p), magnitude = x < 0.0 ? -x : x;
        sum += x * x;
        largest = magnitude > largest ? magnitude : largest;
    }
    return measure == EXEC_NORM ? fm_sqrt(sum) : largest;
}

static inline double exec_norm(const double *x, size_t n)
{
    return exec_measured(EXEC_NORM, FLEDGE_F64, x, n);
}

static inline double exec_max_abs(const double *x, size_t n)
{
    return exec_measured(EXEC_MAX_ABS, FLEDGE_F64, x, n);
}

#endif

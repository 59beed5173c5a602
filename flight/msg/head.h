/* SPDX-License-Identifier: Apache-2.0 */
/* What every message begins with, the time that a module is given, and the rules that all modules
 * follow where data are missing, old or not finite:
 * - An output has the quality of its worst input (quality_through, quality_optional).
 * - If a required input was never written, or the result is not finite, the module does not write its
 *   output. The output keeps its content, time and sequence; its quality falls to QUALITY_DEGRADED
 *   (head_held). An output that was never written stays all zero.
 * - A torque is not held for ever. After a time without new data (data_lost), modules of control and
 *   actuation write one of zero, QUALITY_DEGRADED, and TrackingError computes no more errors from an old attitude.
 *   A reference may be held for ever: the body then keeps to it.
 * - A module does not test its inputs for NaN and infinity. It tests its result.
 * - A module changes its memory only when it writes its output. */
#ifndef FLIGHT_MSG_HEAD_H
#define FLIGHT_MSG_HEAD_H

#include <stdint.h>

/** How far a message may be trusted, in rising order. */
typedef enum Quality {
    QUALITY_NONE = 0,     ///< never written
    QUALITY_STALE = 1,    ///< older than its wire allows
    QUALITY_DEGRADED = 2, ///< made from stale, missing or incomplete data
    QUALITY_GOOD = 3      ///< as intended
} Quality;

/** The first 16 bytes of every message. All zero: the message was never written. */
typedef struct Head {
    int64_t t;         ///< [ns] time of validity, since the start of the run
    Quality quality;   ///< [-]  how far the content may be trusted
    uint32_t sequence; ///< [-]  counts the writings, from 1
} Head;

/** The time that a module's update is called for. */
typedef struct Tick {
    int64_t t;  ///< [ns] now, since the start of the run
    int64_t dt; ///< [ns] since this module's last update; 0 at the first after a reset
} Tick;

/** The time in seconds between two instants in nanoseconds. */
static inline double tick_seconds(int64_t ns)
{
    return (double)ns / 1e9; /* 1e9 is exact, 1e-9 is not: half a second is 0.5 */
}

/** [ns] The time from `start` to `t`; where an int64_t cannot hold it, the nearest that it can. */
static inline int64_t tick_since(int64_t t, int64_t start)
{
    if (start < 0 && t > INT64_MAX + start) {
        return INT64_MAX;
    }
    if (start > 0 && t < INT64_MIN + start) {
        return INT64_MIN;
    }
    return t - start;
}

static inline Quality quality_min(Quality a, Quality b)
{
    return a < b ? a : b;
}

/** The quality of what is computed from an input: stale data degrade, missing data void it. */
static inline Quality quality_through(Head input)
{
    return input.quality == QUALITY_STALE ? QUALITY_DEGRADED : input.quality;
}

static inline int head_written(Head h)
{
    return h.quality != QUALITY_NONE;
}

/** As quality_through, for an input without which the result is whole. */
static inline Quality quality_optional(Head input)
{
    return head_written(input) ? quality_through(input) : QUALITY_GOOD;
}

/** The head of the next writing of an output whose last head was `last`. */
static inline Head head_next(Head last, int64_t t, Quality quality)
{
    return (Head){t, quality, last.sequence + 1u};
}

/** The head of an output that could not be computed anew and holds its last value, if any. */
static inline Head head_held(Head last)
{
    return (Head){last.t, quality_min(last.quality, QUALITY_DEGRADED), last.sequence};
}

/** [ns] The time in an input's head, or t where that is still to come. */
static inline int64_t head_time(Head input, int64_t t)
{
    return input.t < t ? input.t : t;
}

/** [ns] The time for which the content of an input holds: t if it is good, else the time in its head. */
static inline int64_t data_time(Head input, int64_t t)
{
    return input.quality == QUALITY_GOOD || input.t > t ? t : input.t;
}

/** [ns] The earlier of two times. */
static inline int64_t time_min(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

/** Whether data of the time `newest` [ns] are too old to act on: older than `hold` [s], or if that is 0, than ten
 *  updates. At the first update after a reset, for which no time between updates is known, they are not. */
static inline int data_lost(Tick t, int64_t newest, double hold)
{
    double most = hold > 0.0 ? hold : 10.0 * tick_seconds(t.dt);
    return most > 0.0 && tick_seconds(tick_since(t.t, newest)) > most;
}

/** The head of an output that acts, and so is not held for ever (data_lost), for a result of a quality from data of the
 *  time `of` [ns]; QUALITY_NONE: there is no result. `newest` [ns] keeps the time of the data that were used last.
 *  Returns 1 where the output takes the result, 0 where it becomes zero, -1 where it is held. */
static inline int head_acting(Head *head, Tick t, Quality quality, int64_t of, double hold, int64_t *newest)
{
    const int computed = quality != QUALITY_NONE;
    const int lost = head_written(*head) && data_lost(t, computed ? of : *newest, hold);
    if (!lost && !computed) {
        *head = head_held(*head);
        return -1;
    }
    *newest = lost ? *newest : of;
    *head = head_next(*head, t.t, lost ? QUALITY_DEGRADED : quality);
    return !lost;
}

#endif

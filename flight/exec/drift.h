/* SPDX-License-Identifier: Apache-2.0 */
/* A clock that drifts, and that gains an offset at a limited rate. All is integer arithmetic, so that every machine
 * shows the same time: at t, a time s after its last setting,
 *
 *     time = base + s + floor(drift s) + the part of the offset that is done, at most floor(slew s) */
#ifndef FLIGHT_EXEC_DRIFT_H
#define FLIGHT_EXEC_DRIFT_H

#include <stdint.h>

typedef struct ExecClock {
    int64_t since;  ///< [ns] when it was set
    int64_t base;   ///< [ns] its time then
    int64_t offset; ///< [ns] what it shall gain from then on
    int32_t drift;  ///< [ns/s] how much faster than t it runs
    int32_t slew;   ///< [ns/s] how fast it gains or loses the offset
} ExecClock;

/** The largest integer up to s * rate, of a time s >= 0 [ns] and a rate [ns/s]. */
static inline int64_t exec_scaled(int64_t s, int64_t rate)
{
    const int64_t second = INT64_C(1000000000);
    const int64_t part = s % second * rate; /* at most 1e9 times 1e9 */
    return s / second * rate + part / second - (part % second < 0);
}

/** a + b of any two times; beyond the range it wraps, as a counter does. */
static inline int64_t exec_wrapped(int64_t a, int64_t b)
{
    return (int64_t)((uint64_t)a + (uint64_t)b);
}

/** The part of the offset that is done at t. */
static inline int64_t exec_clock_gained(const ExecClock *c, int64_t t)
{
    const int64_t most = exec_scaled(t - c->since, c->slew);
    return c->offset > most ? most : c->offset < -most ? -most : c->offset;
}

static inline int64_t exec_clock_time(const ExecClock *c, int64_t t)
{
    const int64_t s = t - c->since;
    return exec_wrapped(exec_wrapped(c->base, s + exec_scaled(s, c->drift)), exec_clock_gained(c, t));
}

/** At t it shows a time, and gains an offset from then on. */
static inline void exec_clock_set(ExecClock *c, int64_t t, int64_t time, int64_t offset)
{
    c->since = t;
    c->base = time;
    c->offset = offset;
}

#endif

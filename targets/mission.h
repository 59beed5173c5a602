/* SPDX-License-Identifier: Apache-2.0 */
/* What exported missions have in common: how a task keeps its grid of times, how a message ages on
 * its wire, how an event waits, and how a mission lists its messages and parameters for whoever
 * hosts it. The rules are those of the desktop's loop, sim/runtime.cpp, to the bit. */
#ifndef TARGETS_MISSION_H
#define TARGETS_MISSION_H

#include "flight/math/elementary.h"
#include "flight/msg/head.h"

#include <stddef.h>

/* ---- tasks */

/** When a task is due: at offset, offset + period, offset + 2 period, ... */
typedef struct MissionRate {
    int64_t period; ///< [ns] > 0
    int64_t offset; ///< [ns] >= 0
} MissionRate;

typedef struct MissionTask {
    int64_t next;   ///< [ns] when it is due
    int64_t last;   ///< [ns] when it last ran; -1: not since its reset
    int32_t active; ///< 1 if it runs in the mode in effect
    int32_t spare;
} MissionTask;

/** The first time on a task's grid at or after t. */
static inline int64_t mission_on_grid(MissionRate rate, int64_t t)
{
    const int64_t after = t - rate.offset;
    return after <= 0 ? rate.offset : rate.offset + (after + rate.period - 1) / rate.period * rate.period;
}

static inline int mission_due(const MissionTask *task, int64_t t)
{
    return task->active && task->next <= t;
}

/** What the task's modules are called with at t. A task that was called late goes on at the next
 *  time on its grid. */
static inline Tick mission_begin(MissionTask *task, MissionRate rate, int64_t t)
{
    const Tick tick = {t, task->last < 0 ? 0 : t - task->last};
    task->last = t;
    task->next = mission_on_grid(rate, t + 1);
    return tick;
}

/** Make a task active or not. Returns 1 if it was not and now is: its modules are to be reset. */
static inline int mission_switch(MissionTask *task, int active, MissionRate rate, int64_t t)
{
    const int anew = active && !task->active;
    task->active = active;
    if (anew) {
        task->next = mission_on_grid(rate, t);
        task->last = -1;
    }
    return anew;
}

/** The earlier of t and when a task is due. */
static inline int64_t mission_sooner(int64_t t, const MissionTask *task)
{
    return task->active && task->next < t ? task->next : t;
}

/** The same of a task that not every mode runs; `wanted`: the mode asked for does. */
static inline int64_t mission_sooner_in(int64_t t, const MissionTask *task, int wanted, MissionRate rate, int64_t now)
{
    if (!task->active && wanted) {
        const int64_t next = mission_on_grid(rate, now + 1);
        return next < t ? next : t;
    }
    return mission_sooner(t, task);
}

/* ---- wires */

/** Lower the quality of a message that is older than its wire allows. */
static inline void mission_age(Head *head, int64_t t, int64_t stale_after)
{
    if (t - head->t > stale_after && head->quality > QUALITY_STALE) {
        head->quality = QUALITY_STALE;
    }
}

/* ---- events */

/** An event fires when its condition has held for a time, and arms itself again when it no longer
 *  holds, unless it is to fire once. */
typedef struct MissionEvent {
    int64_t since;    ///< [ns] when the condition began to hold; -1: it does not
    int64_t fired_at; ///< [ns] when the event last fired; -1: never
    int32_t armed;
    int32_t spare;
} MissionEvent;

static inline MissionEvent mission_armed(void)
{
    return (MissionEvent){-1, -1, 1, 0};
}

/** Look at an event at t. Returns 1 if it fires. */
static inline int mission_fires(MissionEvent *event, int holds, int64_t hold, int once, int64_t t)
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
static inline double mission_norm(const double *x, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) {
        sum += x[i] * x[i];
    }
    return fm_sqrt(sum);
}

/** The largest magnitude of n numbers; what is not a number does not count. */
static inline double mission_max_abs(const double *x, size_t n)
{
    double largest = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double magnitude = x[i] < 0.0 ? -x[i] : x[i];
        largest = magnitude > largest ? magnitude : largest;
    }
    return largest;
}

/* ---- what a mission tells its host */

typedef enum MissionDirection {
    MISSION_IN = 0,    ///< the host fills it before a tick
    MISSION_OUT = 1,   ///< somebody outside reads it
    MISSION_INSIDE = 2 ///< an output that only flight itself reads, or nobody; for records
} MissionDirection;

/** A message of the mission; its id is its place in the mission's list. */
typedef struct MissionMessage {
    const char *path; ///< of the output that it is: "world.nav.attitude", "flight.motor.command"
    const char *type; ///< "NavAttitude"
    uint32_t offset;  ///< [bytes] in the mission's struct
    uint32_t size;    ///< [bytes]
    MissionDirection direction;
} MissionMessage;

/** The parameters of a module: one block of bytes, without padding. */
typedef struct MissionParameters {
    const char *path; ///< of the module: "flight.control"
    const char *type; ///< "MrpFeedback"
    uint32_t offset;  ///< [bytes] in the mission's struct
    uint32_t size;    ///< [bytes]
} MissionParameters;

#endif

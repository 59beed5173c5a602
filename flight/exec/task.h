/* SPDX-License-Identifier: Apache-2.0 */
/* When a task runs. The desktop's loop and every exported mission use these rules, so that they run
 * the same updates at the same times.
 *
 * Example:
 *
 *     const ExecRate rate = {.period = 500000000, .offset = 0};
 *     ExecTask task = exec_start(rate, 1, 0);
 *     for (int64_t t = 0; t < 2000000000; t = exec_next(&task, rate, 1, t)) {
 *         if (exec_due(&task, t)) {
 *             const Tick tick = exec_begin(&task, rate, t); // for the updates of the task's modules
 *         }
 *     }
 */
#ifndef FLIGHT_EXEC_TASK_H
#define FLIGHT_EXEC_TASK_H

#include "flight/msg/head.h"

/** A task's grid of times: offset, offset + period, offset + 2 period, ... */
typedef struct ExecRate {
    int64_t period; ///< [ns] > 0
    int64_t offset; ///< [ns] >= 0
} ExecRate;

typedef struct ExecTask {
    int64_t next;   ///< [ns] the next time on its grid
    int64_t last;   ///< [ns] when it last ran; -1: not since its reset
    int32_t active; ///< [-]  1 if it runs in the mode in effect
    int32_t spare;
} ExecTask;

/** t + dt; INT64_MAX, which stands for never, if that is beyond. dt >= 0. */
static inline int64_t exec_later(int64_t t, int64_t dt)
{
    /* open: dt is what is left of a period, a difference of which the analyser does not see that it is positive */
    return t > INT64_MAX - dt ? INT64_MAX : t + dt;
}

/** The first time on a task's grid at or after t. */
static inline int64_t exec_on_grid(ExecRate rate, int64_t t)
{
    const int64_t after = tick_since(t, rate.offset);
    if (after <= 0) {
        return rate.offset;
    }
    const int64_t late = after % rate.period;
    return late == 0 ? t : exec_later(t, rate.period - late);
}

/** A task that has not run yet; its first time is at or after t. */
static inline ExecTask exec_start(ExecRate rate, int active, int64_t t)
{
    return (ExecTask){exec_on_grid(rate, t), -1, active, 0};
}

/** Whether a task runs at t. */
static inline int exec_due(const ExecTask *task, int64_t t)
{
    return task->active && task->next <= t;
}

/** The tick of a task that is due at t. A task that runs late continues at the next time on its grid. */
static inline Tick exec_begin(ExecTask *task, ExecRate rate, int64_t t)
{
    const Tick tick = {t, task->last < 0 ? 0 : t - task->last};
    task->last = t;
    task->next = exec_later(task->next, rate.period); /* without the division of exec_on_grid, if the task is in time */
    if (task->next <= t) {
        task->next = exec_on_grid(rate, exec_later(t, 1));
    }
    return tick;
}

/** A mode begins at t, in which the task is active or not. Returns 1 if the task becomes active: the
 *  caller then resets the task's modules. */
static inline int exec_switch(ExecTask *task, int active, ExecRate rate, int64_t t)
{
    const int starts = active && !task->active;
    task->active = active;
    if (starts) {
        *task = exec_start(rate, 1, t);
    }
    return starts;
}

/** When a task runs next, after `now`; INT64_MAX: never. `requested`: whether the requested mode
 *  runs the task. */
static inline int64_t exec_next(const ExecTask *task, ExecRate rate, int requested, int64_t now)
{
    return task->active ? task->next : requested ? exec_on_grid(rate, exec_later(now, 1)) : INT64_MAX;
}

static inline int64_t exec_sooner(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

#endif

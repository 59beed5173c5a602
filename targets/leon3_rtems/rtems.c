/* SPDX-License-Identifier: Apache-2.0 */
/* A mission as an application of RTEMS on a LEON3 board: a thread for each task of flight, and what starts them and
 * targets/bare/main.c.
 *
 * The thread of flight waits for the interrupt of a tick, and has the highest priority. It lets the tasks that are due
 * run, one after the other, in the order of the mission: so flight computes the same bits as everywhere. Their
 * priorities are rate-monotonic, below it: they count beside the threads of an application around flight. */
#include "targets/leon3_rtems/board.h"

#ifndef FLIGHT_PRIORITY
#define FLIGHT_PRIORITY 10 /* of flight; its tasks follow */
#endif
#ifndef TASK_STACK
#define TASK_STACK 16384 /* [bytes] of flight, and of each task */
#endif

#define RUN RTEMS_EVENT_1  /* to a task */
#define DONE RTEMS_EVENT_2 /* to flight: the task has run */

static rtems_id flight;
static struct {
    rtems_id id;
    void (*run)(void *mission, Tick t);
    void *mission;
    Tick t;
} tasks[MISSION_TASKS];

static rtems_task run_task(rtems_task_argument i)
{
    for (;;) {
        leon3_wait_for(RUN, RTEMS_NO_TIMEOUT);
        tasks[i].run(tasks[i].mission, tasks[i].t);
        leon3_expect(rtems_event_send(flight, DONE));
    }
}

void mission_run_task(uint32_t task, void (*run)(void *mission, Tick t), void *mission, Tick t)
{
    tasks[task].run = run;
    tasks[task].mission = mission;
    tasks[task].t = t;
    leon3_expect(rtems_event_send(tasks[task].id, RUN));
    leon3_wait_for(DONE, RTEMS_NO_TIMEOUT);
}

/* Rate-monotonic; of equal periods, in the order of the mission. */
static rtems_task_priority priority(uint32_t i)
{
    const ExecRate *rates = fledge_mission.rates;
    rtems_task_priority priority = FLIGHT_PRIORITY + 1;
    for (uint32_t k = 0u; k < MISSION_TASKS; k++) {
        priority += rates[k].period < rates[i].period || (rates[k].period == rates[i].period && k < i) ? 1u : 0u;
    }
    return priority;
}

static rtems_task begin(rtems_task_argument unused)
{
    (void)unused;
    flight = rtems_task_self();
    for (uint32_t i = 0u; i < MISSION_TASKS; i++) {
        const rtems_name name = rtems_build_name('T', '0' + i / 100u % 10u, '0' + i / 10u % 10u, '0' + i % 10u);
        leon3_expect(
            rtems_task_create(name, priority(i), TASK_STACK, RTEMS_DEFAULT_MODES, RTEMS_FLOATING_POINT, &tasks[i].id));
        leon3_expect(rtems_task_start(tasks[i].id, run_task, i));
    }
    leon3_begin_flight();
    leon3_stop(fledge_fly());
}

#define CONFIGURE_APPLICATION_NEEDS_CLOCK_DRIVER
#define CONFIGURE_APPLICATION_DISABLE_FILESYSTEM
#define CONFIGURE_STACK_CHECKER_ENABLED
#define CONFIGURE_UNIFIED_WORK_AREAS
#define CONFIGURE_INITIAL_EXTENSIONS                                                                                   \
    {                                                                                                                  \
        .thread_begin = leon3_begin_thread                                                                             \
    }
#define CONFIGURE_MAXIMUM_TASKS (MISSION_TASKS + 1)
#define CONFIGURE_EXTRA_TASK_STACKS ((MISSION_TASKS + 1) * TASK_STACK)
#define CONFIGURE_RTEMS_INIT_TASKS_TABLE
#define CONFIGURE_INIT_TASK_ENTRY_POINT begin
#define CONFIGURE_INIT_TASK_PRIORITY FLIGHT_PRIORITY
#define CONFIGURE_INIT_TASK_STACK_SIZE TASK_STACK
#define CONFIGURE_INIT_TASK_ATTRIBUTES RTEMS_FLOATING_POINT
#define CONFIGURE_INIT_TASK_INITIAL_MODES RTEMS_DEFAULT_MODES
#define CONFIGURE_INIT
#include <rtems/confdefs.h>

/* SPDX-License-Identifier: Apache-2.0 */
/* A mission as an application of RTEMS on a LEON3 board: what targets/leon3/main.c needs of the board, and a thread for
 * each task of flight.
 *
 * The thread of flight waits for the interrupt of a tick, and has the highest priority. It lets the tasks that are due
 * run, one after the other, in the order of the mission: so flight computes the same bits as everywhere. Their
 * priorities are rate-monotonic, below it: they count beside the threads of an application around flight. */
#include "targets/leon3/leon3.h"
#include "targets/mission_host.h"

#include <bsp.h>
#include <bsp/watchdog.h>
#include <rtems.h>
#include <rtems/stackchk.h>
#include <stdlib.h>

#ifndef FLIGHT_PRIORITY
#define FLIGHT_PRIORITY 10 /* of flight; its tasks follow */
#endif
#ifndef TASK_STACK
#define TASK_STACK 16384 /* [bytes] of flight, and of each task */
#endif

#define TICK RTEMS_EVENT_0 /* to flight: a tick may have come */
#define RUN RTEMS_EVENT_1  /* to a task */
#define DONE RTEMS_EVENT_2 /* to flight: the task has run */

/* Symbols of the BSP's linker script. */
extern const char text_start[], _endtext[], data_start[], edata[], _end[];

int main(void);

static rtems_id flight;
static struct {
    rtems_id id;
    void (*run)(void *mission, Tick t);
    void *mission;
    Tick t;
} tasks[MISSION_TASKS];
static int watched;

static void expect(rtems_status_code status)
{
    if (status != RTEMS_SUCCESSFUL) {
        rtems_fatal(RTEMS_FATAL_SOURCE_APPLICATION, status);
    }
}

static rtems_event_set wait_for(rtems_event_set event, rtems_interval ticks)
{
    rtems_event_set got = 0;
    const rtems_status_code status = rtems_event_receive(event, RTEMS_EVENT_ANY | RTEMS_WAIT, ticks, &got);
    if (status != RTEMS_TIMEOUT) {
        expect(status);
    }
    return got;
}

/* The nonstandard mode of a GRFPU, as on the bare board: it would trap at a subnormal number. No other trap. */
static void begin_numbers(void)
{
    const uint32_t status = UINT32_C(1) << 22;
    __asm__ volatile("ld %0, %%fsr" : : "m"(status));
}

/* ---- tasks */

static rtems_task run_task(rtems_task_argument i)
{
    begin_numbers();
    for (;;) {
        (void)wait_for(RUN, RTEMS_NO_TIMEOUT);
        tasks[i].run(tasks[i].mission, tasks[i].t);
        expect(rtems_event_send(flight, DONE));
    }
}

void mission_run_task(uint32_t task, void (*run)(void *mission, Tick t), void *mission, Tick t)
{
    tasks[task].run = run;
    tasks[task].mission = mission;
    tasks[task].t = t;
    expect(rtems_event_send(tasks[task].id, RUN));
    (void)wait_for(DONE, RTEMS_NO_TIMEOUT);
}

/* Rate-monotonic; of equal periods, in the order of the mission. */
static rtems_task_priority priority(uint32_t i)
{
    const ExecRate *rates = fledge_mission.rates;
    rtems_task_priority found = FLIGHT_PRIORITY + 1;
    for (uint32_t k = 0u; k < MISSION_TASKS; k++) {
        found += rates[k].period < rates[i].period || (rates[k].period == rates[i].period && k < i) ? 1u : 0u;
    }
    return found;
}

static void start_tasks(void)
{
    for (uint32_t i = 0u; i < MISSION_TASKS; i++) {
        const rtems_name name = rtems_build_name('T', '0' + i / 100u % 10u, '0' + i / 10u % 10u, '0' + i % 10u);
        expect(
            rtems_task_create(name, priority(i), TASK_STACK, RTEMS_DEFAULT_MODES, RTEMS_FLOATING_POINT, &tasks[i].id));
        expect(rtems_task_start(tasks[i].id, run_task, i));
    }
}

/* ---- the board, as leon3.h says */

static void tick_has_come(void *unused)
{
    (void)unused;
    (void)rtems_event_send(flight, TICK);
}

void leon3_idle(void)
{
    if (watched) {
        bsp_watchdog_reload(0, LEON3_PATIENCE_S * 1000000u);
    }
    (void)wait_for(TICK, RTEMS_MILLISECONDS_TO_TICKS(100));
}

void leon3_watch(void)
{
    watched = 1;
}

void leon3_stop(int status)
{
    bsp_watchdog_stop(0);
    exit(status);
}

int64_t leon3_now(void)
{
    return (int64_t)rtems_clock_get_uptime_nanoseconds();
}

static void look_at_stack(const rtems_stack_checker_info *stack, void *most)
{
    uint32_t *found = most;
    const uint32_t used = (uint32_t)stack->used;
    *found = used > *found ? used : *found;
}

uint32_t leon3_stack_used(void)
{
    uint32_t most = 0u;
    rtems_stack_checker_iterate(look_at_stack, &most);
    return most;
}

uint32_t leon3_program_size(void)
{
    return (uint32_t)(_endtext - text_start + (edata - data_start));
}

uint32_t leon3_data_size(void)
{
    return (uint32_t)(_end - _endtext);
}

uint32_t leon3_ram_used(void)
{
    return (uint32_t)(_end - text_start) + (MISSION_TASKS + 1u) * TASK_STACK;
}

/* ---- the application */

static rtems_task begin(rtems_task_argument unused)
{
    (void)unused;
    begin_numbers();
    flight = rtems_task_self();
    leon3_find_devices();
    if (leon3.registers == 0u || leon3.registers_line == 0u) {
        leon3_say("the board has no register space with an interrupt of a tick, so nothing gives flight its time\n");
        leon3_stop(1);
    }
    start_tasks();
    expect(rtems_interrupt_handler_install(leon3.registers_line, "tick", RTEMS_INTERRUPT_UNIQUE, tick_has_come, NULL));
    leon3_stop(main());
}

#define CONFIGURE_APPLICATION_NEEDS_CLOCK_DRIVER
#define CONFIGURE_APPLICATION_DISABLE_FILESYSTEM
#define CONFIGURE_STACK_CHECKER_ENABLED
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

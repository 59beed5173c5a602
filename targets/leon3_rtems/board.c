/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/leon3_rtems/board.h"

#include <bsp.h>
#include <bsp/watchdog.h>
#include <rtems/stackchk.h>
#include <stdlib.h>

#define TICK RTEMS_EVENT_0 /* to flight: a tick may have come */

/* Symbols of the BSP's linker script. */
extern const char text_start[], _endtext[], data_start[], edata[], _end[];

static rtems_id flight; /* 0: none yet */
static int watched;

void leon3_expect(rtems_status_code status)
{
    if (status != RTEMS_SUCCESSFUL) {
        rtems_fatal(RTEMS_FATAL_SOURCE_APPLICATION, status);
    }
}

void leon3_wait_for(rtems_event_set events, rtems_interval ticks)
{
    rtems_event_set got = 0;
    const rtems_status_code status = rtems_event_receive(events, RTEMS_EVENT_ANY | RTEMS_WAIT, ticks, &got);
    if (status != RTEMS_TIMEOUT) {
        leon3_expect(status);
    }
}

void leon3_begin_thread(rtems_tcb *thread)
{
    const uint32_t float_status = UINT32_C(1) << 22;
    uint32_t psr;
    (void)thread;
    __asm__ volatile("rd %%psr, %0" : "=r"(psr));
    if ((psr & 0x1000u) != 0u) { /* it has the FPU */
        __asm__ volatile("ld %0, %%fsr" : : "m"(float_status));
    }
}

static void tick_has_come(void *unused)
{
    (void)unused;
    (void)rtems_event_send(flight, TICK);
}

static void (*of_level[16])(void);

static void board_interrupts(void *level)
{
    of_level[(uintptr_t)level]();
}

void leon3_on_interrupt(uint32_t level, void (*handler)(void))
{
    const int is_first = of_level[level] == NULL; /* an app that starts again is not */
    of_level[level] = handler;
    if (is_first) {
        leon3_expect(rtems_interrupt_handler_install(level, "board", RTEMS_INTERRUPT_UNIQUE, board_interrupts,
                                                     (void *)(uintptr_t)level));
    }
}

void leon3_begin_flight(void)
{
    const int first = flight == 0u;
    flight = rtems_task_self();
    if (!first) {
        return;
    }
    leon3_find_devices();
    if (leon3.registers == 0u || leon3.registers_line == 0u) {
        bare_say("the board has no register space with an interrupt of a tick, so nothing gives flight its time\n");
        leon3_stop(1);
    }
    leon3_expect(
        rtems_interrupt_handler_install(leon3.registers_line, "tick", RTEMS_INTERRUPT_UNIQUE, tick_has_come, NULL));
}

void bare_idle(void)
{
    if (watched) {
        bsp_watchdog_reload(0, BARE_PATIENCE_S * 1000000u);
    }
    leon3_wait_for(TICK, RTEMS_MILLISECONDS_TO_TICKS(100));
}

void bare_watch(void)
{
    watched = 1;
}

void leon3_stop(int status)
{
    bsp_watchdog_stop(0);
    exit(status);
}

int64_t bare_now(void)
{
    return (int64_t)rtems_clock_get_uptime_nanoseconds();
}

static void look_at_stack(const rtems_stack_checker_info *stack, void *most)
{
    uint32_t *peak = most;
    const uint32_t used = (uint32_t)stack->used;
    *peak = used > *peak ? used : *peak;
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
    Heap_Information_block heap; /* with the threads' stacks, because the work areas are one */
    (void)rtems_workspace_get_information(&heap);
    return (uint32_t)(_end - text_start) + (uint32_t)heap.Used.total;
}

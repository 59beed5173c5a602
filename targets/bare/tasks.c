/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/bare/tasks.h"

#include "targets/bare/bare.h"
#include "targets/bare/context.h"
#include "targets/cfs/config.h"
#include "targets/cfs/port.h"

#ifndef TASK_STACK
#define TASK_STACK 24576 /* [bytes] */
#endif
#define PAINT 0x5ac3a53cu /* of a stack that was never used */

/* ---- tasks */

static struct {
    BareContext context;
    void (*entry)(uint32);
    int used;
    int blocked;
    int64 until;
} tasks[POCKET_TASKS];
static uint64_t stacks[POCKET_TASKS][TASK_STACK / 8];
static uint32 running;
static uint32 waits_for_tick; /* the task; 0: none, for task 0 never does */
static int polled;            /* it has read the registers since another task ran or the board was idle */

void port_start(const char *root)
{
    (void)root;
    tasks[0].used = 1;
}

void port_lock(void) {}

void port_unlock(void) {}

static void begin(uint32_t slot)
{
    tasks[slot].entry(slot);
    port_task_end();
}

int port_task_start(uint32 slot, void (*entry)(uint32 slot), void *stack, size_t stack_size, uint32 priority)
{
    (void)priority;
    if (stack == NULL) {
        stack = stacks[slot];
        if (stack_size > sizeof stacks[slot]) {
            return 1;
        }
        stack_size = sizeof stacks[slot];
    }
    for (size_t i = 0; i < stack_size / 4u; i++) {
        ((uint32_t *)stack)[i] = PAINT;
    }
    tasks[slot].context = bare_context(stack, stack_size, begin, slot);
    tasks[slot].entry = entry;
    tasks[slot].blocked = 0;
    tasks[slot].used = 1;
    return 0;
}

/* The next task that can go on, in turn. */
static uint32 next(void)
{
    for (;;) {
        const int64 now = port_now();
        for (uint32 k = 1; k <= POCKET_TASKS; k++) {
            const uint32 i = (running + k) % POCKET_TASKS;
            if (tasks[i].used && (!tasks[i].blocked || (tasks[i].until >= 0 && tasks[i].until <= now))) {
                polled = 0;
                return i;
            }
        }
        if (waits_for_tick != 0u && !polled) { /* a tick may have come meanwhile */
            polled = 1;
            return waits_for_tick;
        }
        bare_idle();
        polled = 0;
    }
}

static void give_way(void)
{
    const uint32 from = running;
    running = next();
    tasks[running].blocked = 0;
    if (running != from) {
        bare_switch(&tasks[from].context, &tasks[running].context);
    }
}

void port_task_end(void)
{
    tasks[running].used = 0;
    give_way();
}

uint32 port_task_self(void)
{
    return running;
}

void port_block(int64 until_ns)
{
    tasks[running].until = until_ns;
    tasks[running].blocked = 1;
    give_way();
}

void port_unblock(uint32 slot)
{
    tasks[slot].blocked = 0;
}

void port_wait_for_tick(void)
{
    waits_for_tick = running;
    port_block(-1);
    waits_for_tick = 0u;
}

uint32 port_stack_used(void)
{
    uint32 most = 0u;
    for (uint32 i = 0u; i < POCKET_TASKS; i++) {
        uint32 n = 0u;
        while (n < TASK_STACK / 4u && ((const uint32_t *)stacks[i])[n] == PAINT) {
            n++;
        }
        most = tasks[i].entry != NULL && TASK_STACK - 4u * n > most ? TASK_STACK - 4u * n : most;
    }
    return most;
}

/* ---- time and the console */

int64 port_now(void)
{
    return bare_now();
}

void port_console(const char *text, size_t n)
{
    (void)n;
    bare_say(text);
}

/* ---- apps are linked */

void *port_load(const char *name, const char *entry_name, void (**entry)(void))
{
    (void)name;
    (void)entry_name;
    *entry = NULL;
    return NULL;
}

void port_unload(void *code)
{
    (void)code;
}

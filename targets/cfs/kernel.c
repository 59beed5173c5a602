/* SPDX-License-Identifier: Apache-2.0 */
/* Tasks and their synchronization: a task sleeps on an address, and the task that changes the object at that address
 * wakes all tasks that sleep on it. */
#include "targets/cfs/core.h"

#include <stdio.h>
#include <string.h>

Core pocket_core;

static void end(uint32 slot)
{
    Task *task = &pocket_core.tasks[slot];
    task->used = false;
    task->generation++;
    pocket_wake_locked(&pocket_core.tasks); /* CFE_ES_ExitApp waits for the end of child tasks */
    port_unlock();
    port_task_end();
}

void pocket_lock(void)
{
    port_lock();
    const uint32 self = port_task_self();
    if (pocket_core.tasks[self].deleted) {
        end(self);
    }
}

void pocket_unlock(void)
{
    port_unlock();
}

bool pocket_sleep_locked(const void *channel, int64 until_ns)
{
    const uint32 self = port_task_self();
    Task *task = &pocket_core.tasks[self];
    task->channel = channel;
    task->woken = false;
    while (!task->woken && !task->deleted && (until_ns < 0 || port_now() < until_ns)) {
        port_block(until_ns);
    }
    task->channel = NULL;
    if (task->deleted) {
        end(self);
    }
    return task->woken;
}

void pocket_wake_locked(const void *channel)
{
    for (uint32 i = 0; i < POCKET_TASKS; i++) {
        Task *task = &pocket_core.tasks[i];
        if (task->used && task->channel == channel && !task->woken) {
            task->woken = true;
            port_unblock(i);
        }
    }
}

int64 pocket_until(int64 ms)
{
    return ms < 0 ? -1 : port_now() + ms * 1000000;
}

void pocket_print(const char *format, va_list list)
{
    char text[256];
    const int n = vsnprintf(text, sizeof text, format, list);
    if (n > 0) {
        port_console(text, (size_t)n < sizeof text ? (size_t)n : sizeof text - 1u);
    }
}

uint32 pocket_self_app_locked(void)
{
    return pocket_core.tasks[port_task_self()].app;
}

static void run(uint32 slot)
{
    pocket_lock();
    void (*entry)(void) = pocket_core.tasks[slot].entry;
    pocket_unlock();
    entry();
    pocket_lock();
    pocket_task_end_locked();
}

uint32 pocket_task_start_locked(uint32 app, const char *name, void (*entry)(void), void *stack, size_t stack_size,
                                uint32 priority)
{
    for (uint32 i = 1; i < POCKET_TASKS; i++) {
        Task *task = &pocket_core.tasks[i];
        if (task->used) {
            continue;
        }
        const uint16 generation = task->generation;
        memset(task, 0, sizeof *task);
        task->generation = generation;
        (void)pocket_name(task->name, sizeof task->name, name);
        task->entry = entry;
        task->app = app;
        task->used = true;
        if (port_task_start(i, run, stack, stack_size, priority) != 0) {
            task->used = false;
            return POCKET_TASKS;
        }
        return i;
    }
    return POCKET_TASKS;
}

void pocket_task_delete_locked(uint32 slot)
{
    Task *task = &pocket_core.tasks[slot];
    if (task->used) {
        task->deleted = true;
        port_unblock(slot);
    }
}

void pocket_task_end_locked(void)
{
    end(port_task_self());
}

uint32 pocket_task_id_locked(uint32 slot)
{
    return make_id(KIND_TASK, pocket_core.tasks[slot].generation, slot);
}

uint32 pocket_task_of_locked(uint32 id)
{
    const uint32 slot = index_of(id, KIND_TASK, POCKET_TASKS);
    return slot < POCKET_TASKS && pocket_core.tasks[slot].used && pocket_task_id_locked(slot) == id ? slot
                                                                                                    : POCKET_TASKS;
}

bool pocket_name(char *to, size_t room, const char *name)
{
    size_t n = 0;
    while (name && name[n] != '\0' && n < room) {
        n++;
    }
    const bool fits = n > 0 && n < room;
    if (n >= room) {
        n = room - 1u;
    }
    memset(to, 0, room);
    if (n > 0) {
        memcpy(to, name, n);
    }
    return fits;
}

/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: a port as a board without an operating system has it. Each task has a stack of its own,
 * and another one runs only when one waits; nothing is preempted, and the lock is nothing. Time
 * stands still while a task runs. When all wait, the outside is asked (bare_idle); where it has
 * nothing to do, time goes on to the first that waits for it. There are no files. */
#define _XOPEN_SOURCE 700
#include "targets/cfs/config.h"
#include "targets/cfs/port.h"

#include <stdio.h>
#include <stdlib.h>
#include <ucontext.h>

#define STACK 65536

/* 1: something has happened that a task may wait for. */
int bare_idle(void);

static struct {
    ucontext_t context;
    void (*entry)(uint32);
    int used;
    int blocked;
    int64 until;
    long double stack[STACK / sizeof(long double)];
} tasks[POCKET_TASKS];
static uint32 running;
static int64 now;

void port_start(const char *root)
{
    (void)root;
    tasks[0].used = 1;
}

void port_lock(void) {}

void port_unlock(void) {}

static void begin(void)
{
    tasks[running].entry(running);
}

int port_task_start(uint32 slot, void (*entry)(uint32 slot), void *stack, size_t stack_size, uint32 priority)
{
    (void)stack;
    (void)stack_size;
    (void)priority;
    (void)getcontext(&tasks[slot].context);
    tasks[slot].context.uc_stack.ss_sp = tasks[slot].stack;
    tasks[slot].context.uc_stack.ss_size = STACK;
    tasks[slot].context.uc_link = NULL;
    makecontext(&tasks[slot].context, begin, 0);
    tasks[slot].entry = entry;
    tasks[slot].used = 1;
    tasks[slot].blocked = 0;
    return 0;
}

/* The next task that can go on, in turn. */
static uint32 next(void)
{
    for (;;) {
        int64 first = INT64_MAX;
        for (uint32 k = 1; k <= POCKET_TASKS; k++) {
            const uint32 i = (running + k) % POCKET_TASKS;
            if (tasks[i].used && (!tasks[i].blocked || (tasks[i].until >= 0 && tasks[i].until <= now))) {
                return i;
            }
            if (tasks[i].used && tasks[i].until >= 0 && tasks[i].until < first) {
                first = tasks[i].until;
            }
        }
        if (!bare_idle()) {
            if (first == INT64_MAX) {
                (void)fprintf(stderr, "all tasks wait, for nothing\n");
                exit(3);
            }
            now = first;
        }
    }
}

static void give_way(void)
{
    const uint32 from = running;
    running = next();
    tasks[running].blocked = 0;
    if (running != from) {
        (void)swapcontext(&tasks[from].context, &tasks[running].context);
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
    tasks[running].blocked = 1;
    tasks[running].until = until_ns;
    give_way();
}

void port_unblock(uint32 slot)
{
    tasks[slot].blocked = 0;
}

int64 port_now(void)
{
    return now;
}

void port_console(const char *text, size_t n)
{
    (void)fwrite(text, 1, n, stderr);
}

int32 port_file_open(const char *path, int access, int create, int truncate)
{
    (void)path;
    (void)access;
    (void)create;
    (void)truncate;
    return -1;
}

int32 port_file_read(int32 file, void *bytes, size_t n)
{
    (void)file;
    (void)bytes;
    (void)n;
    return -1;
}

int32 port_file_write(int32 file, const void *bytes, size_t n)
{
    (void)file;
    (void)bytes;
    (void)n;
    return -1;
}

int32 port_file_seek(int32 file, int32 offset, uint32 whence)
{
    (void)file;
    (void)offset;
    (void)whence;
    return -1;
}

int32 port_file_close(int32 file)
{
    (void)file;
    return -1;
}

int32 port_file_remove(const char *path)
{
    (void)path;
    return -1;
}

int32 port_file_rename(const char *from, const char *to)
{
    (void)from;
    (void)to;
    return -1;
}

int32 port_folder_make(const char *path)
{
    (void)path;
    return -1;
}

int32 port_folder_remove(const char *path)
{
    (void)path;
    return -1;
}

int32 port_folder_open(const char *path)
{
    (void)path;
    return -1;
}

int32 port_folder_read(int32 folder, char *name, size_t room)
{
    (void)folder;
    (void)name;
    (void)room;
    return -1;
}

int32 port_folder_close(int32 folder)
{
    (void)folder;
    return -1;
}

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

/* SPDX-License-Identifier: Apache-2.0 */
/* What the pocket's files know of one another. A name that ends in _locked wants the lock held; all
 * others take it themselves. Nothing of an app is called with the lock held. */
#ifndef TARGETS_CFS_CORE_H
#define TARGETS_CFS_CORE_H

#include "targets/cfs/config.h"
#include "targets/cfs/pocket.h"
#include "targets/cfs/port.h"

/* Ids that apps hold: kind, generation, index. One that was deleted is not taken for its successor. */
enum { KIND_APP = 1, KIND_TASK, KIND_PIPE, KIND_STORE, KIND_MUTEX, KIND_BINARY, KIND_COUNTING, KIND_QUEUE, KIND_FILE };

static inline uint32 make_id(uint32 kind, uint32 generation, uint32 index)
{
    return (kind << 28) | ((generation & 0xffffu) << 8) | (index + 1u);
}

/** The index of an id, or n if it is not one of this kind in 0 ... n - 1. */
static inline uint32 index_of(uint32 id, uint32 kind, uint32 n)
{
    const uint32 index = (id & 0xffu) - 1u;
    return (id >> 28) == kind && index < n ? index : n;
}

typedef struct App {
    char name[CFE_MISSION_MAX_API_LEN];
    const PocketApp *program;
    uint32 priority;
    size_t stack_size;
    uint32 main_task;
    uint16 generation;
    bool used;
    bool ready;   ///< it has come to its first RunLoop or WaitForStartupSync
    bool restart; ///< when it ends
    bool restarted;
    uint32 asked; ///< RunStatus that RunLoop shall give; 0: go on

    bool events; ///< registered
    uint16 n_filters;
    CFE_EVS_BinFilter_t filters[POCKET_FILTERS];
    uint16 seen[POCKET_FILTERS];
} App;

typedef struct Task {
    char name[OS_MAX_API_NAME];
    void (*entry)(void);
    uint32 app;
    uint16 generation;
    bool used;
    bool doomed; ///< deleted: it ends at its next call
    bool woken;
    const void *channel; ///< what it waits for
} Task;

typedef struct Core {
    const PocketApp *programs;
    uint32 n_programs;
    bool operational;
    bool quiet;
    int64 start_ns;
    App apps[POCKET_APPS]; ///< the first is the host
    Task tasks[POCKET_TASKS];
    PocketCounts counts;
} Core;

extern Core pocket_core;

/* kernel.c */

/** Take the lock; a task that was deleted ends here instead. */
void pocket_lock(void);
void pocket_unlock(void);
/** Wait for pocket_wake_locked of the same channel, or a time. False: the time has come. */
bool pocket_sleep_locked(const void *channel, int64 until_ns);
void pocket_wake_locked(const void *channel);
/** When so many milliseconds are over; -1 for less than 0. */
int64 pocket_until(int64 ms);
uint32 pocket_self_app_locked(void);
/** The slot of a new task, or POCKET_TASKS. */
uint32 pocket_task_start_locked(uint32 app, const char *name, void (*entry)(void), void *stack, size_t stack_size,
                                uint32 priority);
void pocket_task_doom_locked(uint32 slot);
/** The running task ends; the lock is given back. */
void pocket_task_end_locked(void);
uint32 pocket_task_id_locked(uint32 slot);
/** The slot of an id, or POCKET_TASKS. */
uint32 pocket_task_of_locked(uint32 id);
/** Copy a name; false if it is empty or does not fit. */
bool pocket_name(char *to, size_t room, const char *name);

/* What the services do when an app ends. */
void pocket_sb_forget_locked(uint32 app);
void pocket_tbl_forget_locked(uint32 app);
void pocket_osal_forget_locked(uint32 app);
void pocket_sb_start(void);
void pocket_tbl_start(void);
void pocket_es_start(void);
void pocket_osal_start(void);

/** An event of the pocket itself, under the name of a service. */
void pocket_event(const char *service, uint16 id, uint16 type, const char *format, ...) OS_PRINTF(4, 5);
/** A command for the tables, in the sender's task. */
void pocket_tbl_command(const CFE_MSG_Message_t *message, size_t size);

static inline size_t pocket_size(const CFE_MSG_Message_t *message)
{
    return ((size_t)message->Byte[4] << 8 | message->Byte[5]) + 7u;
}

#endif

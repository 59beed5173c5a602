/* SPDX-License-Identifier: Apache-2.0 */
/* The internal interface of the pocket cFE's files. The caller of a function whose name ends in _locked holds the
 * lock; all other functions take it themselves. The pocket never calls an app's function while it holds the lock. */
#ifndef TARGETS_CFS_CORE_H
#define TARGETS_CFS_CORE_H

#include "targets/cfs/config.h"
#include "targets/cfs/pocket.h"
#include "targets/cfs/port.h"

#include <stdarg.h>

/* An id consists of kind, generation and index. Its generation distinguishes a deleted object from the
 * object that took its place. */
enum { KIND_APP = 1, KIND_TASK, KIND_PIPE, KIND_STORE, KIND_MUTEX, KIND_BINARY, KIND_COUNTING, KIND_FILE, KIND_FOLDER };

static inline uint32 make_id(uint32 kind, uint32 generation, uint32 index)
{
    return (kind << 28) | ((generation & 0xffffu) << 8) | (index + 1u);
}

/** The index in an id of this kind, or n if the kind or the index (0 ... n - 1) is wrong. */
static inline uint32 index_of(uint32 id, uint32 kind, uint32 n)
{
    const uint32 index = (id & 0xffu) - 1u;
    return (id >> 28) == kind && index < n ? index : n;
}

typedef struct App {
    char name[CFE_MISSION_MAX_API_LEN];
    void (*entry)(void);
    void *code; ///< of an app that is loaded, not linked
    char file[CFE_MISSION_MAX_FILE_LEN];
    char entry_name[CFE_MISSION_MAX_FILE_LEN];
    uint32 priority;
    size_t stack_size;
    uint32 main_task;
    uint16 generation;
    bool used;
    bool ready;   ///< it has called RunLoop or WaitForStartupSync
    bool restart; ///< start it again when it ends
    bool restarted;
    uint32 requested; ///< the RunStatus that RunLoop returns; 0: continue

    bool events; ///< registered with EVS
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
    bool deleted; ///< it ends at its next call of the pocket
    bool woken;
    const void *channel; ///< the address on which it sleeps
} Task;

typedef struct Core {
    const PocketApp *programs;
    uint32 n_programs;
    bool operational;
    bool quiet;
    int64 start_ns;
    App apps[POCKET_APPS]; ///< the first one is the host
    Task tasks[POCKET_TASKS];
    PocketCounts counts;
} Core;

extern Core pocket_core;

/* kernel.c */

/** Take the lock. A deleted task ends here. */
void pocket_lock(void);
void pocket_unlock(void);
/** Sleep until pocket_wake_locked of the same channel, or until a time. False: timeout. */
bool pocket_sleep_locked(const void *channel, int64 until_ns);
void pocket_wake_locked(const void *channel);
/** The time [ns] that many milliseconds from now; -1 (no timeout) if ms < 0. */
int64 pocket_until(int64 ms);
uint32 pocket_self_app_locked(void);
/** The slot of a new task, or POCKET_TASKS. */
uint32 pocket_task_start_locked(uint32 app, const char *name, void (*entry)(void), void *stack, size_t stack_size,
                                uint32 priority);
/** The task ends at its next call of the pocket, or now if it sleeps there. */
void pocket_task_delete_locked(uint32 slot);
/** End the running task, and release the lock. */
void pocket_task_end_locked(void);
uint32 pocket_task_id_locked(uint32 slot);
/** The slot of an id, or POCKET_TASKS. */
uint32 pocket_task_of_locked(uint32 id);
/** Copy a name; false if it is empty or does not fit. */
bool pocket_name(char *to, size_t room, const char *name);

/** Whether there is an app with this entry point, linked or in this file. */
bool pocket_program(const char *file, const char *entry_name);
/** Print to the console of the port. */
void pocket_print(const char *format, va_list list);

/* Each service releases the objects of an app when the app ends. */
void pocket_sb_app_ended_locked(uint32 app);
void pocket_tbl_app_ended_locked(uint32 app);
void pocket_osal_app_ended_locked(uint32 app);
void pocket_sb_start(void);
void pocket_tbl_start(void);
void pocket_es_start(void);
void pocket_osal_start(void);

/** Send an event of the pocket itself, under the name of a service. */
void pocket_event(const char *service, uint16 id, uint16 type, const char *format, ...) OS_PRINTF(4, 5);
/** Execute a command for the table service, in the sender's task. */
void pocket_tbl_command(const CFE_MSG_Message_t *message, size_t size);

static inline uint32 pocket_id(const CFE_MSG_Message_t *message)
{
    return (uint32)message->Byte[0] << 8 | message->Byte[1];
}

static inline size_t pocket_size(const CFE_MSG_Message_t *message)
{
    return ((size_t)message->Byte[4] << 8 | message->Byte[5]) + 7u;
}

#endif

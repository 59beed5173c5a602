/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cfs/core.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef struct Semaphore {
    char name[OS_MAX_API_NAME];
    uint32 kind;
    uint32 app;
    uint32 value; ///< of a mutex: how often its owner has it
    uint32 owner; ///< of a mutex: a task's id
    uint32 flushed;
    uint16 generation;
    bool used;
} Semaphore;

typedef struct Queue {
    char name[OS_MAX_API_NAME];
    uint32 app;
    uint32 depth;
    uint32 size; ///< [bytes] of an item
    uint32 first;
    uint32 n;
    uint16 generation;
    bool used;
    uint8 bytes[POCKET_QUEUE_BYTES];
} Queue;

typedef struct File {
    int32 port;
    uint32 app;
    uint16 generation;
    bool used;
} File;

static struct {
    Semaphore semaphores[POCKET_SEMAPHORES];
    Queue queues[POCKET_QUEUES];
    File files[POCKET_FILES];
} os;

void pocket_osal_start(void)
{
    memset(&os, 0, sizeof os);
}

void OS_printf(const char *string, ...)
{
    char text[256];
    va_list list;
    va_start(list, string);
    const int n = vsnprintf(text, sizeof text, string, list);
    va_end(list);
    if (n > 0) {
        port_console(text, (size_t)n < sizeof text ? (size_t)n : sizeof text - 1u);
    }
}

/* ---- tasks */

int32 OS_TaskCreate(osal_id_t *task_id, const char *task_name, osal_task_entry function_pointer,
                    osal_stackptr_t stack_pointer, size_t stack_size, osal_priority_t priority, uint32 flags)
{
    (void)flags;
    if (task_id == NULL || task_name == NULL || function_pointer == NULL) {
        return OS_INVALID_POINTER;
    }
    pocket_lock();
    const uint32 slot = pocket_task_start_locked(pocket_self_app_locked(), task_name, function_pointer, stack_pointer,
                                                 stack_size, priority);
    *task_id = slot < POCKET_TASKS ? pocket_task_id_locked(slot) : OS_OBJECT_ID_UNDEFINED;
    pocket_unlock();
    return slot < POCKET_TASKS ? OS_SUCCESS : OS_ERR_NO_FREE_IDS;
}

int32 OS_TaskDelete(osal_id_t task_id)
{
    pocket_lock();
    const uint32 slot = pocket_task_of_locked(task_id);
    const bool found = slot > 0u && slot < POCKET_TASKS;
    if (found) {
        pocket_task_doom_locked(slot);
    }
    pocket_unlock();
    return found ? OS_SUCCESS : OS_ERR_INVALID_ID;
}

void OS_TaskExit(void)
{
    if (port_task_self() != 0u) {
        pocket_lock();
        pocket_task_end_locked();
    }
}

osal_id_t OS_TaskGetId(void)
{
    pocket_lock();
    const osal_id_t id = pocket_task_id_locked(port_task_self());
    pocket_unlock();
    return id;
}

int32 OS_TaskDelay(uint32 millisecond)
{
    static const char never_woken;
    pocket_lock();
    const int64 until = pocket_until((int64)millisecond);
    while (pocket_sleep_locked(&never_woken, until)) {
    }
    pocket_unlock();
    return OS_SUCCESS;
}

/* ---- semaphores */

static Semaphore *semaphore_of(osal_id_t id, uint32 kind)
{
    const uint32 i = index_of(id, kind, POCKET_SEMAPHORES);
    return i < POCKET_SEMAPHORES && os.semaphores[i].used && os.semaphores[i].kind == kind &&
                   make_id(kind, os.semaphores[i].generation, i) == id
               ? &os.semaphores[i]
               : NULL;
}

static int32 create(osal_id_t *id, const char *name, uint32 kind, uint32 value)
{
    Semaphore *free_one = NULL;
    char short_name[OS_MAX_API_NAME];
    int32 status = OS_SUCCESS;
    if (id == NULL || name == NULL) {
        return OS_INVALID_POINTER;
    }
    if (!pocket_name(short_name, sizeof short_name, name)) {
        return OS_ERR_NAME_TOO_LONG;
    }
    if (kind == KIND_BINARY && value > OS_SEM_FULL) {
        return OS_INVALID_SEM_VALUE;
    }
    pocket_lock();
    for (uint32 i = 0; i < POCKET_SEMAPHORES; i++) {
        Semaphore *s = &os.semaphores[i];
        if (!s->used) {
            free_one = free_one == NULL ? s : free_one;
        } else if (s->kind == kind && strcmp(s->name, short_name) == 0) {
            status = OS_ERR_NAME_TAKEN;
        }
    }
    if (status == OS_SUCCESS && free_one == NULL) {
        status = OS_ERR_NO_FREE_IDS;
    }
    if (status == OS_SUCCESS) {
        const Semaphore fresh = {.kind = kind,
                                 .app = pocket_self_app_locked(),
                                 .value = value,
                                 .generation = free_one->generation,
                                 .used = true};
        *free_one = fresh;
        memcpy(free_one->name, short_name, sizeof short_name);
        *id = make_id(kind, fresh.generation, (uint32)(free_one - os.semaphores));
    }
    pocket_unlock();
    return status;
}

static void forget(Semaphore *s)
{
    s->used = false;
    s->generation++;
    pocket_wake_locked(s);
}

static int32 delete_semaphore(osal_id_t id, uint32 kind)
{
    pocket_lock();
    Semaphore *s = semaphore_of(id, kind);
    if (s != NULL) {
        forget(s);
    }
    pocket_unlock();
    return s != NULL ? OS_SUCCESS : OS_ERR_INVALID_ID;
}

/* Binary and counting: one less, as soon as there is one. ms < 0: without end. */
static int32 take(osal_id_t id, uint32 kind, int64 ms)
{
    int32 status = OS_SUCCESS;
    pocket_lock();
    const int64 until = pocket_until(ms);
    Semaphore *s = semaphore_of(id, kind);
    const uint32 flushed = s != NULL ? s->flushed : 0u;
    while (s != NULL && status == OS_SUCCESS && s->value == 0u && s->flushed == flushed) {
        if (!pocket_sleep_locked(s, until)) {
            status = OS_SEM_TIMEOUT;
        }
        s = semaphore_of(id, kind);
    }
    if (s == NULL) {
        status = OS_ERR_INVALID_ID;
    } else if (s->value > 0u && s->flushed == flushed) {
        s->value--;
        status = OS_SUCCESS;
    }
    pocket_unlock();
    return status;
}

static int32 give(osal_id_t id, uint32 kind)
{
    int32 status = OS_SUCCESS;
    pocket_lock();
    Semaphore *s = semaphore_of(id, kind);
    if (s == NULL) {
        status = OS_ERR_INVALID_ID;
    } else if (kind == KIND_COUNTING && s->value == UINT32_MAX) {
        status = OS_SEM_FAILURE;
    } else {
        s->value = kind == KIND_BINARY ? 1u : s->value + 1u;
        pocket_wake_locked(s);
    }
    pocket_unlock();
    return status;
}

int32 OS_MutSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 options)
{
    (void)options;
    return create(sem_id, sem_name, KIND_MUTEX, 0);
}

int32 OS_MutSemTake(osal_id_t sem_id)
{
    pocket_lock();
    const uint32 self = pocket_task_id_locked(port_task_self());
    Semaphore *s = semaphore_of(sem_id, KIND_MUTEX);
    while (s != NULL && s->value > 0u && s->owner != self) {
        (void)pocket_sleep_locked(s, -1);
        s = semaphore_of(sem_id, KIND_MUTEX);
    }
    if (s != NULL) {
        s->value++;
        s->owner = self;
    }
    pocket_unlock();
    return s != NULL ? OS_SUCCESS : OS_ERR_INVALID_ID;
}

int32 OS_MutSemGive(osal_id_t sem_id)
{
    int32 status = OS_ERR_INVALID_ID;
    pocket_lock();
    Semaphore *s = semaphore_of(sem_id, KIND_MUTEX);
    if (s != NULL) {
        status = OS_SEM_FAILURE;
        if (s->value > 0u && s->owner == pocket_task_id_locked(port_task_self())) {
            s->value--;
            pocket_wake_locked(s);
            status = OS_SUCCESS;
        }
    }
    pocket_unlock();
    return status;
}

int32 OS_MutSemDelete(osal_id_t sem_id)
{
    return delete_semaphore(sem_id, KIND_MUTEX);
}

int32 OS_BinSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 sem_initial_value, uint32 options)
{
    (void)options;
    return create(sem_id, sem_name, KIND_BINARY, sem_initial_value);
}

int32 OS_BinSemTake(osal_id_t sem_id)
{
    return take(sem_id, KIND_BINARY, -1);
}

int32 OS_BinSemTimedWait(osal_id_t sem_id, uint32 msecs)
{
    return take(sem_id, KIND_BINARY, (int64)msecs);
}

int32 OS_BinSemGive(osal_id_t sem_id)
{
    return give(sem_id, KIND_BINARY);
}

int32 OS_BinSemFlush(osal_id_t sem_id)
{
    pocket_lock();
    Semaphore *s = semaphore_of(sem_id, KIND_BINARY);
    if (s != NULL) {
        s->flushed++;
        pocket_wake_locked(s);
    }
    pocket_unlock();
    return s != NULL ? OS_SUCCESS : OS_ERR_INVALID_ID;
}

int32 OS_BinSemDelete(osal_id_t sem_id)
{
    return delete_semaphore(sem_id, KIND_BINARY);
}

int32 OS_CountSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 sem_initial_value, uint32 options)
{
    (void)options;
    return create(sem_id, sem_name, KIND_COUNTING, sem_initial_value);
}

int32 OS_CountSemTake(osal_id_t sem_id)
{
    return take(sem_id, KIND_COUNTING, -1);
}

int32 OS_CountSemTimedWait(osal_id_t sem_id, uint32 msecs)
{
    return take(sem_id, KIND_COUNTING, (int64)msecs);
}

int32 OS_CountSemGive(osal_id_t sem_id)
{
    return give(sem_id, KIND_COUNTING);
}

int32 OS_CountSemDelete(osal_id_t sem_id)
{
    return delete_semaphore(sem_id, KIND_COUNTING);
}

/* ---- queues */

static Queue *queue_of(osal_id_t id)
{
    const uint32 i = index_of(id, KIND_QUEUE, POCKET_QUEUES);
    return i < POCKET_QUEUES && os.queues[i].used && make_id(KIND_QUEUE, os.queues[i].generation, i) == id
               ? &os.queues[i]
               : NULL;
}

int32 OS_QueueCreate(osal_id_t *queue_id, const char *queue_name, size_t queue_depth, size_t data_size, uint32 flags)
{
    Queue *free_one = NULL;
    char name[OS_MAX_API_NAME];
    int32 status = OS_SUCCESS;
    (void)flags;
    if (queue_id == NULL || queue_name == NULL) {
        return OS_INVALID_POINTER;
    }
    if (!pocket_name(name, sizeof name, queue_name)) {
        return OS_ERR_NAME_TOO_LONG;
    }
    if (queue_depth == 0u || data_size == 0u || data_size > POCKET_QUEUE_BYTES ||
        queue_depth > POCKET_QUEUE_BYTES / data_size) {
        return OS_QUEUE_INVALID_SIZE;
    }
    pocket_lock();
    for (uint32 i = 0; i < POCKET_QUEUES; i++) {
        Queue *q = &os.queues[i];
        if (!q->used) {
            free_one = free_one == NULL ? q : free_one;
        } else if (strcmp(q->name, name) == 0) {
            status = OS_ERR_NAME_TAKEN;
        }
    }
    if (status == OS_SUCCESS && free_one == NULL) {
        status = OS_ERR_NO_FREE_IDS;
    }
    if (status == OS_SUCCESS) {
        memcpy(free_one->name, name, sizeof name);
        free_one->app = pocket_self_app_locked();
        free_one->depth = (uint32)queue_depth;
        free_one->size = (uint32)data_size;
        free_one->first = free_one->n = 0;
        free_one->used = true;
        *queue_id = make_id(KIND_QUEUE, free_one->generation, (uint32)(free_one - os.queues));
    }
    pocket_unlock();
    return status;
}

int32 OS_QueueGet(osal_id_t queue_id, void *data, size_t size, size_t *size_copied, int32 timeout)
{
    int32 status = OS_SUCCESS;
    if (data == NULL || size_copied == NULL) {
        return OS_INVALID_POINTER;
    }
    *size_copied = 0;
    pocket_lock();
    const int64 until = pocket_until(timeout);
    Queue *q = queue_of(queue_id);
    if (q != NULL && size < q->size) {
        status = OS_QUEUE_INVALID_SIZE;
    }
    while (q != NULL && status == OS_SUCCESS && q->n == 0u) {
        if (timeout == OS_CHECK) {
            status = OS_QUEUE_EMPTY;
        } else if (!pocket_sleep_locked(q, until)) {
            status = OS_QUEUE_TIMEOUT;
        }
        q = queue_of(queue_id);
    }
    if (q == NULL) {
        status = OS_ERR_INVALID_ID;
    } else if (status == OS_SUCCESS) {
        memcpy(data, q->bytes + q->first * q->size, q->size);
        q->first = (q->first + 1u) % q->depth;
        q->n--;
        *size_copied = q->size;
    }
    pocket_unlock();
    return status;
}

int32 OS_QueuePut(osal_id_t queue_id, const void *data, size_t size, uint32 flags)
{
    int32 status = OS_SUCCESS;
    (void)flags;
    if (data == NULL) {
        return OS_INVALID_POINTER;
    }
    pocket_lock();
    Queue *q = queue_of(queue_id);
    if (q == NULL) {
        status = OS_ERR_INVALID_ID;
    } else if (size > q->size) {
        status = OS_QUEUE_INVALID_SIZE;
    } else if (q->n == q->depth) {
        status = OS_QUEUE_FULL;
    } else {
        uint8 *item = q->bytes + (q->first + q->n) % q->depth * q->size;
        memset(item, 0, q->size);
        memcpy(item, data, size);
        q->n++;
        pocket_wake_locked(q);
    }
    pocket_unlock();
    return status;
}

static void forget_queue(Queue *q)
{
    q->used = false;
    q->generation++;
    pocket_wake_locked(q);
}

int32 OS_QueueDelete(osal_id_t queue_id)
{
    pocket_lock();
    Queue *q = queue_of(queue_id);
    if (q != NULL) {
        forget_queue(q);
    }
    pocket_unlock();
    return q != NULL ? OS_SUCCESS : OS_ERR_INVALID_ID;
}

/* ---- files */

int32 OS_OpenCreate(osal_id_t *filedes, const char *path, int32 flags, int32 access_mode)
{
    int32 status = OS_ERR_NO_FREE_IDS;
    if (filedes == NULL || path == NULL) {
        return OS_INVALID_POINTER;
    }
    *filedes = OS_OBJECT_ID_UNDEFINED;
    if (strlen(path) >= OS_MAX_PATH_LEN) {
        return OS_FS_ERR_PATH_TOO_LONG;
    }
    pocket_lock();
    for (uint32 i = 0; i < POCKET_FILES; i++) {
        File *f = &os.files[i];
        if (f->used) {
            continue;
        }
        f->port = port_file_open(path, access_mode, flags & OS_FILE_FLAG_CREATE, flags & OS_FILE_FLAG_TRUNCATE);
        status = OS_ERROR;
        if (f->port >= 0) {
            f->used = true;
            f->app = pocket_self_app_locked();
            *filedes = make_id(KIND_FILE, f->generation, i);
            status = OS_SUCCESS;
        }
        break;
    }
    pocket_unlock();
    return status;
}

/* The port's number of a file, or -1. */
static int32 port_of(osal_id_t id)
{
    pocket_lock();
    const uint32 i = index_of(id, KIND_FILE, POCKET_FILES);
    const bool found = i < POCKET_FILES && os.files[i].used && make_id(KIND_FILE, os.files[i].generation, i) == id;
    const int32 port = found ? os.files[i].port : -1;
    pocket_unlock();
    return port;
}

int32 OS_read(osal_id_t filedes, void *buffer, size_t nbytes)
{
    const int32 port = port_of(filedes);
    if (buffer == NULL) {
        return OS_INVALID_POINTER;
    }
    return port < 0 ? OS_ERR_INVALID_ID : port_file_read(port, buffer, nbytes);
}

int32 OS_write(osal_id_t filedes, const void *buffer, size_t nbytes)
{
    const int32 port = port_of(filedes);
    if (buffer == NULL) {
        return OS_INVALID_POINTER;
    }
    return port < 0 ? OS_ERR_INVALID_ID : port_file_write(port, buffer, nbytes);
}

int32 OS_lseek(osal_id_t filedes, int32 offset, uint32 whence)
{
    const int32 port = port_of(filedes);
    return port < 0 ? OS_ERR_INVALID_ID : port_file_seek(port, offset, whence);
}

int32 OS_close(osal_id_t filedes)
{
    const int32 port = port_of(filedes);
    if (port < 0) {
        return OS_ERR_INVALID_ID;
    }
    pocket_lock();
    File *f = &os.files[index_of(filedes, KIND_FILE, POCKET_FILES)];
    f->used = false;
    f->generation++;
    pocket_unlock();
    return port_file_close(port) == 0 ? OS_SUCCESS : OS_ERROR;
}

int32 OS_remove(const char *path)
{
    if (path == NULL) {
        return OS_INVALID_POINTER;
    }
    return port_file_remove(path) == 0 ? OS_SUCCESS : OS_ERROR;
}

/* ---- an app has ended */

void pocket_osal_forget_locked(uint32 app)
{
    for (uint32 i = 0; i < POCKET_SEMAPHORES; i++) {
        if (os.semaphores[i].used && os.semaphores[i].app == app) {
            forget(&os.semaphores[i]);
        }
    }
    for (uint32 i = 0; i < POCKET_QUEUES; i++) {
        if (os.queues[i].used && os.queues[i].app == app) {
            forget_queue(&os.queues[i]);
        }
    }
    for (uint32 i = 0; i < POCKET_FILES; i++) {
        if (os.files[i].used && os.files[i].app == app) {
            (void)port_file_close(os.files[i].port);
            os.files[i].used = false;
            os.files[i].generation++;
        }
    }
}

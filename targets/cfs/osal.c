/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cfs/core.h"

#include <string.h>

/* One table holds all semaphores, then all open files and folders. */
enum { FIRST_FILE = POCKET_SEMAPHORES, OBJECTS = FIRST_FILE + POCKET_FILES };

typedef struct Object {
    char name[OS_MAX_API_NAME];
    uint32 kind;
    uint32 app; ///< that created it
    uint16 generation;
    bool used;
    uint32 value;   ///< of a semaphore; of a mutex: how often its owner has taken it
    uint32 owner;   ///< of a mutex: the id of a task
    uint32 flushed; ///< of a binary semaphore: how often a task has flushed it
    int32 port;     ///< of a file or folder: the port's number
} Object;

static struct {
    Object objects[OBJECTS];
} os;

void pocket_osal_start(void)
{
    memset(&os, 0, sizeof os);
}

void OS_printf(const char *string, ...)
{
    va_list list;
    va_start(list, string);
    pocket_print(string, list);
    va_end(list);
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
    const bool valid = slot > 0u && slot < POCKET_TASKS;
    if (valid) {
        pocket_task_delete_locked(slot);
    }
    pocket_unlock();
    return valid ? OS_SUCCESS : OS_ERR_INVALID_ID;
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

/* ---- objects */

static Object *object_of(osal_id_t id, uint32 kind)
{
    const uint32 i = index_of(id, kind, OBJECTS);
    Object *o = &os.objects[i < OBJECTS ? i : 0u];
    return i < OBJECTS && o->used && o->kind == kind && make_id(kind, o->generation, i) == id ? o : NULL;
}

/* Create an object of the calling app. Files and folders have no name. */
static int32 create_locked(osal_id_t *id, const char *name, uint32 kind, Object **created)
{
    const uint32 first = kind >= KIND_FILE ? FIRST_FILE : 0u;
    const uint32 end = kind >= KIND_FILE ? OBJECTS : FIRST_FILE;
    Object *object = NULL;
    for (uint32 i = first; i < end; i++) {
        Object *o = &os.objects[i];
        if (!o->used) {
            object = object == NULL ? o : object;
        } else if (name != NULL && o->kind == kind && strcmp(o->name, name) == 0) {
            return OS_ERR_NAME_TAKEN;
        }
    }
    if (object == NULL) {
        return OS_ERR_NO_FREE_IDS;
    }
    const Object fresh = {
        .kind = kind, .app = pocket_self_app_locked(), .generation = object->generation, .used = true};
    *object = fresh;
    (void)pocket_name(object->name, sizeof object->name, name);
    *id = make_id(kind, fresh.generation, (uint32)(object - os.objects));
    *created = object;
    return OS_SUCCESS;
}

static int32 delete_locked(Object *o)
{
    const int32 closed = o->kind == KIND_FILE     ? port_file_close(o->port)
                         : o->kind == KIND_FOLDER ? port_folder_close(o->port)
                                                  : 0;
    o->used = false;
    o->generation++;
    pocket_wake_locked(o);
    return closed == 0 ? OS_SUCCESS : OS_ERROR;
}

static int32 delete_object(osal_id_t id, uint32 kind)
{
    pocket_lock();
    Object *o = object_of(id, kind);
    const int32 status = o != NULL ? delete_locked(o) : OS_ERR_INVALID_ID;
    pocket_unlock();
    return status;
}

void pocket_osal_app_ended_locked(uint32 app)
{
    for (uint32 i = 0; i < OBJECTS; i++) {
        if (os.objects[i].used && os.objects[i].app == app) {
            (void)delete_locked(&os.objects[i]);
        }
    }
}

/* ---- semaphores */

static int32 create_semaphore(osal_id_t *id, const char *name, uint32 kind, uint32 value)
{
    char short_name[OS_MAX_API_NAME];
    Object *s;
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
    const int32 status = create_locked(id, short_name, kind, &s);
    if (status == OS_SUCCESS) {
        s->value = value;
    }
    pocket_unlock();
    return status;
}

/* Of a binary or counting semaphore: wait until its value is not 0, then decrement it. ms < 0: no timeout. */
static int32 take(osal_id_t id, uint32 kind, int64 ms)
{
    int32 status = OS_SUCCESS;
    pocket_lock();
    const int64 until = pocket_until(ms);
    Object *s = object_of(id, kind);
    const uint32 flushed = s != NULL ? s->flushed : 0u;
    while (s != NULL && status == OS_SUCCESS && s->value == 0u && s->flushed == flushed) {
        if (!pocket_sleep_locked(s, until)) {
            status = OS_SEM_TIMEOUT;
        }
        s = object_of(id, kind);
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
    Object *s = object_of(id, kind);
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
    return create_semaphore(sem_id, sem_name, KIND_MUTEX, 0);
}

int32 OS_MutSemTake(osal_id_t sem_id)
{
    pocket_lock();
    const uint32 self = pocket_task_id_locked(port_task_self());
    Object *s = object_of(sem_id, KIND_MUTEX);
    while (s != NULL && s->value > 0u && s->owner != self) {
        (void)pocket_sleep_locked(s, -1);
        s = object_of(sem_id, KIND_MUTEX);
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
    Object *s = object_of(sem_id, KIND_MUTEX);
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
    return delete_object(sem_id, KIND_MUTEX);
}

int32 OS_BinSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 sem_initial_value, uint32 options)
{
    (void)options;
    return create_semaphore(sem_id, sem_name, KIND_BINARY, sem_initial_value);
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
    Object *s = object_of(sem_id, KIND_BINARY);
    if (s != NULL) {
        s->flushed++;
        pocket_wake_locked(s);
    }
    pocket_unlock();
    return s != NULL ? OS_SUCCESS : OS_ERR_INVALID_ID;
}

int32 OS_BinSemDelete(osal_id_t sem_id)
{
    return delete_object(sem_id, KIND_BINARY);
}

int32 OS_CountSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 sem_initial_value, uint32 options)
{
    (void)options;
    return create_semaphore(sem_id, sem_name, KIND_COUNTING, sem_initial_value);
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
    return delete_object(sem_id, KIND_COUNTING);
}

/* ---- files */

/* Open a file or a folder. */
static int32 open_path(osal_id_t *id, const char *path, uint32 kind, int32 flags, int32 access)
{
    Object *f;
    if (id == NULL || path == NULL) {
        return OS_INVALID_POINTER;
    }
    *id = OS_OBJECT_ID_UNDEFINED;
    if (strlen(path) >= OS_MAX_PATH_LEN) {
        return OS_FS_ERR_PATH_TOO_LONG;
    }
    pocket_lock();
    int32 status = create_locked(id, NULL, kind, &f);
    if (status == OS_SUCCESS) {
        f->port = kind == KIND_FOLDER
                      ? port_folder_open(path)
                      : port_file_open(path, access, flags & OS_FILE_FLAG_CREATE, flags & OS_FILE_FLAG_TRUNCATE);
        if (f->port < 0) {
            f->used = false;
            *id = OS_OBJECT_ID_UNDEFINED;
            status = OS_ERROR;
        }
    }
    pocket_unlock();
    return status;
}

int32 OS_OpenCreate(osal_id_t *filedes, const char *path, int32 flags, int32 access_mode)
{
    return open_path(filedes, path, KIND_FILE, flags, access_mode);
}

/* The port's number of a file or folder, or -1. */
static int32 port_of(osal_id_t id, uint32 kind)
{
    pocket_lock();
    const Object *f = object_of(id, kind);
    const int32 port = f != NULL ? f->port : -1;
    pocket_unlock();
    return port;
}

int32 OS_read(osal_id_t filedes, void *buffer, size_t nbytes)
{
    const int32 port = port_of(filedes, KIND_FILE);
    if (buffer == NULL) {
        return OS_INVALID_POINTER;
    }
    return port < 0 ? OS_ERR_INVALID_ID : port_file_read(port, buffer, nbytes);
}

int32 OS_write(osal_id_t filedes, const void *buffer, size_t nbytes)
{
    const int32 port = port_of(filedes, KIND_FILE);
    if (buffer == NULL) {
        return OS_INVALID_POINTER;
    }
    return port < 0 ? OS_ERR_INVALID_ID : port_file_write(port, buffer, nbytes);
}

int32 OS_lseek(osal_id_t filedes, int32 offset, uint32 whence)
{
    const int32 port = port_of(filedes, KIND_FILE);
    return port < 0 ? OS_ERR_INVALID_ID : port_file_seek(port, offset, whence);
}

int32 OS_close(osal_id_t filedes)
{
    return delete_object(filedes, KIND_FILE);
}

int32 OS_remove(const char *path)
{
    if (path == NULL) {
        return OS_INVALID_POINTER;
    }
    return port_file_remove(path) == 0 ? OS_SUCCESS : OS_ERROR;
}

int32 OS_rename(const char *old_filename, const char *new_filename)
{
    if (old_filename == NULL || new_filename == NULL) {
        return OS_INVALID_POINTER;
    }
    return port_file_rename(old_filename, new_filename) == 0 ? OS_SUCCESS : OS_ERROR;
}

int32 OS_mkdir(const char *path, uint32 access)
{
    (void)access;
    if (path == NULL) {
        return OS_INVALID_POINTER;
    }
    return port_folder_make(path) == 0 ? OS_SUCCESS : OS_ERROR;
}

int32 OS_rmdir(const char *path)
{
    if (path == NULL) {
        return OS_INVALID_POINTER;
    }
    return port_folder_remove(path) == 0 ? OS_SUCCESS : OS_ERROR;
}

int32 OS_DirectoryOpen(osal_id_t *dir_id, const char *path)
{
    return open_path(dir_id, path, KIND_FOLDER, 0, 0);
}

int32 OS_DirectoryRead(osal_id_t dir_id, os_dirent_t *dirent)
{
    const int32 port = port_of(dir_id, KIND_FOLDER);
    if (dirent == NULL) {
        return OS_INVALID_POINTER;
    }
    if (port < 0) {
        return OS_ERR_INVALID_ID;
    }
    return port_folder_read(port, dirent->FileName, sizeof dirent->FileName) == 0 ? OS_SUCCESS : OS_ERROR;
}

int32 OS_DirectoryClose(osal_id_t dir_id)
{
    return delete_object(dir_id, KIND_FOLDER);
}

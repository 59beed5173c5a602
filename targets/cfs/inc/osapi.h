/* SPDX-License-Identifier: Apache-2.0 */
/* OSAL: tasks, semaphores, files. */
#ifndef OSAPI_H
#define OSAPI_H

#include "cfe_config.h"
#include "common_types.h"

typedef uint32 osal_id_t;
typedef void *osal_stackptr_t;
typedef uint32 osal_priority_t;
typedef void (*osal_task_entry)(void);

#define OS_OBJECT_ID_UNDEFINED ((osal_id_t)0)
#define OS_TASK_STACK_ALLOCATE NULL
#define OS_PRIORITY_C(x) ((osal_priority_t)(x))

#define OS_SUCCESS 0
#define OS_ERROR (-1)
#define OS_INVALID_POINTER (-2)
#define OS_ERROR_TIMEOUT (-4)
#define OS_SEM_FAILURE (-6)
#define OS_SEM_TIMEOUT (-7)
#define OS_ERR_NAME_TOO_LONG (-13)
#define OS_ERR_NO_FREE_IDS (-14)
#define OS_ERR_NAME_TAKEN (-15)
#define OS_ERR_INVALID_ID (-16)
#define OS_INVALID_SEM_VALUE (-20)
#define OS_FS_ERR_PATH_TOO_LONG (-103)
#define OS_FS_ERR_PATH_INVALID (-108)

#define OS_PEND (-1)
#define OS_CHECK 0
#define OS_SEM_EMPTY 0
#define OS_SEM_FULL 1

#define OS_READ_ONLY 0
#define OS_WRITE_ONLY 1
#define OS_READ_WRITE 2
#define OS_FILE_FLAG_NONE 0
#define OS_FILE_FLAG_CREATE 1
#define OS_FILE_FLAG_TRUNCATE 2
#define OS_SEEK_SET 0U
#define OS_SEEK_CUR 1U
#define OS_SEEK_END 2U

typedef struct {
    char FileName[OS_MAX_FILE_NAME];
} os_dirent_t;
#define OS_DIRENTRY_NAME(x) ((x).FileName)

void OS_printf(const char *string, ...) OS_PRINTF(1, 2);

int32 OS_TaskCreate(osal_id_t *task_id, const char *task_name, osal_task_entry function_pointer,
                    osal_stackptr_t stack_pointer, size_t stack_size, osal_priority_t priority, uint32 flags);
int32 OS_TaskDelete(osal_id_t task_id);
void OS_TaskExit(void);
int32 OS_TaskDelay(uint32 millisecond);
osal_id_t OS_TaskGetId(void);

/** The task that holds a mutex may take it again. */
int32 OS_MutSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 options);
int32 OS_MutSemTake(osal_id_t sem_id);
int32 OS_MutSemGive(osal_id_t sem_id);
int32 OS_MutSemDelete(osal_id_t sem_id);

int32 OS_BinSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 sem_initial_value, uint32 options);
int32 OS_BinSemTake(osal_id_t sem_id);
int32 OS_BinSemTimedWait(osal_id_t sem_id, uint32 msecs);
int32 OS_BinSemGive(osal_id_t sem_id);
/** Wake all tasks that wait; the value of the semaphore does not change. */
int32 OS_BinSemFlush(osal_id_t sem_id);
int32 OS_BinSemDelete(osal_id_t sem_id);

int32 OS_CountSemCreate(osal_id_t *sem_id, const char *sem_name, uint32 sem_initial_value, uint32 options);
int32 OS_CountSemTake(osal_id_t sem_id);
int32 OS_CountSemTimedWait(osal_id_t sem_id, uint32 msecs);
int32 OS_CountSemGive(osal_id_t sem_id);
int32 OS_CountSemDelete(osal_id_t sem_id);

/** Files below /cf and /ram. The results are counts of bytes, or a negative error. */
int32 OS_OpenCreate(osal_id_t *filedes, const char *path, int32 flags, int32 access_mode);
int32 OS_read(osal_id_t filedes, void *buffer, size_t nbytes);
int32 OS_write(osal_id_t filedes, const void *buffer, size_t nbytes);
int32 OS_lseek(osal_id_t filedes, int32 offset, uint32 whence);
int32 OS_close(osal_id_t filedes);
int32 OS_remove(const char *path);
int32 OS_rename(const char *old_filename, const char *new_filename);

int32 OS_mkdir(const char *path, uint32 access);
int32 OS_rmdir(const char *path);
int32 OS_DirectoryOpen(osal_id_t *dir_id, const char *path);
/** The next entry, in no order, also `.` and `..`; OS_ERROR behind the last. */
int32 OS_DirectoryRead(osal_id_t dir_id, os_dirent_t *dirent);
int32 OS_DirectoryClose(osal_id_t dir_id);

#endif

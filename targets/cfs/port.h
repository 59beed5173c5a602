/* SPDX-License-Identifier: Apache-2.0 */
/* The functions that the pocket needs from a machine. port_posix.c implements them for POSIX, targets/bare/tasks.c
 * for a board without an operating system: it needs a stack for each task and a switch between them; no function needs
 * preemption. */
#ifndef TARGETS_CFS_PORT_H
#define TARGETS_CFS_PORT_H

#include "targets/cfs/inc/common_types.h"

/** The first call, by task 0, which boots the pocket. root: the folder that holds cf and ram, if the port has folders.
 */
void port_start(const char *root);

/** One lock guards the state of the pocket. A task never takes it twice, and holds it for a short time. */
void port_lock(void);
void port_unlock(void);

/** Start task `slot`, which runs entry(slot). The caller holds the lock. Returns 0, or not 0 if no task is free. */
int port_task_start(uint32 slot, void (*entry)(uint32 slot), void *stack, size_t stack_size, uint32 priority);
/** End the running task. The caller does not hold the lock. */
void port_task_end(void);
/** The number of the running task. */
uint32 port_task_self(void);

/** Release the lock, which the caller holds, wait until another task unblocks this one or until a time (less than 0: no
 *  timeout), and take the lock again. May return early. */
void port_block(int64 until_ns);
/** Unblock task `slot`. The caller holds the lock. */
void port_unblock(uint32 slot);

/** Load the code of an app, the file NAME.so below /cf, and find its entry point; NULL: there is none. */
void *port_load(const char *name, const char *entry_name, void (**entry)(void));
/** Unload it: static data begin anew when it is loaded again. */
void port_unload(void *code);

/** [ns] of a monotonic clock. */
int64 port_now(void);

void port_console(const char *text, size_t n);

/** Files below /cf and /ram. Less than 0: an error. access: OS_READ_ONLY ...; create, truncate: 0 or 1. */
int32 port_file_open(const char *path, int access, int create, int truncate);
int32 port_file_read(int32 file, void *bytes, size_t n);
int32 port_file_write(int32 file, const void *bytes, size_t n);
int32 port_file_seek(int32 file, int32 offset, uint32 whence);
int32 port_file_close(int32 file);
int32 port_file_remove(const char *path);
int32 port_file_rename(const char *from, const char *to);
int32 port_folder_make(const char *path);
int32 port_folder_remove(const char *path);
int32 port_folder_open(const char *path);
/** The name of the next entry, cut to `room` with its end; less than 0: there is none. */
int32 port_folder_read(int32 folder, char *name, size_t room);
int32 port_folder_close(int32 folder);

#endif

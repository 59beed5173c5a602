/* SPDX-License-Identifier: Apache-2.0 */
/* All that the pocket asks of a machine. port_posix.c is that of POSIX; a bare board brings its own,
 * with as many stacks as it has tasks and a switch between them: nothing here asks for preemption. */
#ifndef TARGETS_CFS_PORT_H
#define TARGETS_CFS_PORT_H

#include "common_types.h"

/** Before anything else, by the task that boots, which is task 0. root: the folder that holds cf and
 *  ram, where the port has folders. */
void port_start(const char *root);

/** One lock guards all of the pocket's state. Not nested; short. */
void port_lock(void);
void port_unlock(void);

/** Make task `slot` run entry(slot). 0: it will; else there is no room. With the lock held. */
int port_task_start(uint32 slot, void (*entry)(uint32 slot), void *stack, size_t stack_size, uint32 priority);
/** The running task ends. Not with the lock held. */
void port_task_end(void);
/** The number of the running task. */
uint32 port_task_self(void);

/** With the lock held, which is given up meanwhile: the running task waits until it is unblocked or
 *  until a time has come; less than 0: without end. May return early. */
void port_block(int64 until_ns);
/** With the lock held: let task `slot` go on. */
void port_unblock(uint32 slot);

/** A clock that never goes back [ns]. */
int64 port_now(void);

void port_console(const char *text, size_t n);

/** Files below /cf and /ram. Less than 0: not possible. access as OS_READ_ONLY ...; create, truncate: 0, 1. */
int32 port_file_open(const char *path, int access, int create, int truncate);
int32 port_file_read(int32 file, void *bytes, size_t n);
int32 port_file_write(int32 file, const void *bytes, size_t n);
int32 port_file_seek(int32 file, int32 offset, uint32 whence);
int32 port_file_close(int32 file);
int32 port_file_remove(const char *path);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The port of the pocket cFE (targets/cfs/port.h) to a board without an operating system, over bare.h and context.h.
 * tasks.c: each task has a stack, and another task runs only when one waits; when all wait, the board is idle. Apps are
 * linked with the program. files.c: files in memory. */
#ifndef TARGETS_BARE_TASKS_H
#define TARGETS_BARE_TASKS_H

#include "common_types.h"

#include <stddef.h>

/** A file is there. Its bytes must stay. */
void port_add_file(const char *path, const uint8 *bytes, size_t n);
/** The running task waits until the outside may have started a tick. */
void port_wait_for_tick(void);
/** [bytes] The largest of all tasks' stacks, so far. */
uint32 port_stack_used(void);

#endif

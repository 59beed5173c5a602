/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: a process as a board without an operating system. Time stands still while a task runs. */
#ifndef TARGETS_CFS_TESTING_CONTEXTS_H
#define TARGETS_CFS_TESTING_CONTEXTS_H

/** Called when all tasks wait; NULL: there is no outside. */
extern void (*contexts_outside)(void);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Threads of execution that give way to each other: a board needs them for tasks. */
#ifndef TARGETS_BARE_CONTEXT_H
#define TARGETS_BARE_CONTEXT_H

#include <stddef.h>
#include <stdint.h>

/** One that waits. */
typedef struct BareContext {
    uintptr_t sp, pc;
} BareContext;

/** One that begins with entry(argument), which does not return. */
BareContext bare_context(void *stack, size_t size, void (*entry)(uint32_t), uint32_t argument);
/** Store the running one, and go on with another one. Interrupts stay as they are. */
void bare_switch(BareContext *from, const BareContext *to);

#endif

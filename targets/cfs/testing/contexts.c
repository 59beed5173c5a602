/* SPDX-License-Identifier: Apache-2.0 */
#define _XOPEN_SOURCE 700
#include "targets/cfs/testing/contexts.h"

#include "targets/bare/bare.h"
#include "targets/bare/context.h"
#include "targets/cfs/config.h"

#include <stdio.h>
#include <ucontext.h>

#define STEP INT64_C(1000000) /* [ns] of time, each time the board is idle */

void (*contexts_outside)(void);

static int64_t now; /* [ns] */
static ucontext_t contexts[POCKET_TASKS];
static void (*entries[POCKET_TASKS])(uint32_t);

static void enter(int slot)
{
    entries[slot]((uint32_t)slot);
}

BareContext bare_context(void *stack, size_t size, void (*entry)(uint32_t), uint32_t argument)
{
    ucontext_t *c = &contexts[argument];
    entries[argument] = entry;
    (void)getcontext(c);
    c->uc_stack.ss_sp = stack;
    c->uc_stack.ss_size = size;
    c->uc_link = NULL;
    makecontext(c, (void (*)(void))enter, 1, (int)argument);
    return (BareContext){(uintptr_t)c, 0u};
}

void bare_switch(BareContext *from, const BareContext *to)
{
    if (from->sp == 0u) { /* the first task, which was not made by a call */
        from->sp = (uintptr_t)&contexts[0];
    }
    (void)swapcontext((ucontext_t *)from->sp, (const ucontext_t *)to->sp);
}

void bare_idle(void)
{
    now += STEP;
    if (contexts_outside != NULL) {
        contexts_outside();
    }
}

int64_t bare_now(void)
{
    return now;
}

void bare_say(const char *text)
{
    (void)fputs(text, stderr);
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/burn_plan.h"

#include <string.h>

void burn_plan_reset(BurnPlan *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* [ns] -1: it is no time. */
static int64_t start_of(const BurnPlan *m, uint32_t burn)
{
    const double start = m->par.start[burn] * 1e9 + 0.5;
    return start >= 0.0 && start < 1e18 ? (int64_t)start : -1;
}

void burn_plan_update(BurnPlan *m, Tick t)
{
    const BurnState *state = &m->in.state, *kept = &m->in.kept;
    DeltaVCommand *command = &m->out.command;
    /* undecided: a guard of the array; the bounds of the parameter are within */
    const uint32_t n = m->par.n < PLANNED_BURNS_MAX ? m->par.n : PLANNED_BURNS_MAX;
    if (quality_optional(kept->head) != QUALITY_GOOD && !head_written(command->head)) {
        return;
    }
    for (uint32_t i = 0u; i < n && head_written(kept->head) && !head_written(command->head); i++) {
        m->mem.next = kept->phase > BURN_WAITS && kept->start == start_of(m, i) ? i : m->mem.next;
    }
    if (head_written(state->head) && head_written(command->head) && state->start == command->start) {
        m->mem.ended |= state->phase == BURN_ABORTED;
        m->mem.next += state->phase == BURN_COMPLETE && m->mem.next + 1u < n && !m->mem.ended;
    }
    const uint32_t next = m->mem.next;
    if (next >= n) { /* a command lowered n */
        command->head = head_held(command->head);
        return;
    }
    const int64_t start = start_of(m, next);
    if (start >= 0 && vec_finite(m->par.dv_N[next]) && vec_finite(m->par.rate_N[next])) {
        *command =
            (DeltaVCommand){head_next(command->head, t.t, QUALITY_GOOD), start, m->par.dv_N[next], m->par.rate_N[next]};
    } else {
        command->head = head_held(command->head);
    }
}

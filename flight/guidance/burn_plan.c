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
    const Vec3 dv_N = m->par.dv_N[m->mem.next], rate_N = m->par.rate_N[m->mem.next];
    const int64_t start = start_of(m, m->mem.next);
    if (vec_finite(dv_N) && vec_finite(rate_N) && start >= 0) {
        *command = (DeltaVCommand){head_next(command->head, t.t, QUALITY_GOOD), start, dv_N, rate_N};
    } else {
        command->head = head_held(command->head);
    }
}

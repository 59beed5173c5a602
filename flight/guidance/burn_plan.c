/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/burn_plan.h"

#include <string.h>

void burn_plan_reset(BurnPlan *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void burn_plan_update(BurnPlan *m, Tick t)
{
    const BurnState *state = &m->in.state;
    DeltaVCommand *command = &m->out.command;
    const uint32_t n = m->par.n < PLANNED_BURNS_MAX ? m->par.n : PLANNED_BURNS_MAX;
    if (head_written(state->head) && head_written(command->head) && state->start == command->start) {
        m->mem.ended |= state->phase == BURN_ABORTED;
        m->mem.next += state->phase == BURN_COMPLETE && m->mem.next + 1u < n && !m->mem.ended;
    }
    const Vec3 dv_N = m->par.dv_N[m->mem.next], rate_N = m->par.rate_N[m->mem.next];
    const double start = m->par.start[m->mem.next] * 1e9 + 0.5;
    if (vec_finite(dv_N) && vec_finite(rate_N) && start >= 0.0 && start < 1e18) {
        *command = (DeltaVCommand){head_next(command->head, t.t, QUALITY_GOOD), (int64_t)start, dv_N, rate_N};
    } else {
        command->head = head_held(command->head);
    }
}

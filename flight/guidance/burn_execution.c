/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/burn_execution.h"

#include <string.h>

#include "flight/math/attitude.h"

void burn_execution_reset(BurnExecution *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static int same(const DeltaVCommand *a, const DeltaVCommand *b)
{
    return a->start == b->start && memcmp(&a->dv_N, &b->dv_N, sizeof a->dv_N) == 0 &&
           memcmp(&a->rate_N, &b->rate_N, sizeof a->rate_N) == 0;
}

static int usable(const DeltaVCommand *command)
{
    return head_written(command->head) && vec_finite(command->rate_N);
}

/* Whether the attitude allows a burn. */
static int points(const BurnExecution *m, Tick t)
{
    const AttError *error = &m->in.error;
    const int opens = m->out.state.phase != BURN_RUNS && m->par.error_open > 0.0;
    const double most = opens ? m->par.error_open : m->par.error_max;
    if (!(most > 0.0)) {
        return 1;
    }
    return head_written(error->head) && mrp_angle(error->sigma_BR) <= most &&
           !data_lost(t, data_time(error->head, t.t), m->par.hold);
}

static void end(BurnState *state, int64_t t, BurnPhase phase, BurnAbort why)
{
    state->phase = phase;
    state->abort = why;
    state->ended = t;
}

/* [m/s^2] along what counts as gained; *gained [m/s] of now. */
static double progress(BurnExecution *m, int64_t t, double *gained)
{
    const DeltaVSum *sum = &m->in.sum;
    const int turns = vec_norm2(m->mem.taken.rate_N) > 0.0;
    const Vec3 along = vec_unit(m->mem.taken.dv_N);
    const double a = turns ? vec_norm(sum->a_N) : vec_dot(along, sum->a_N);
    const double then = turns ? sum->path - m->mem.path : vec_dot(along, vec_sub(sum->dv_N, m->mem.dv_N));
    *gained = m->mem.before + then + a * tick_seconds(tick_since(t, sum->head.t));
    return a;
}

/* Of a burn that runs: opens the engines for a time, or ends it. */
static void run(BurnExecution *m, Tick t, int blind)
{
    BurnState *state = &m->out.state;
    double gained;
    const double a = progress(m, t.t, &gained);
    const double size = vec_norm(m->mem.taken.dv_N);
    const double burnt = tick_seconds(tick_since(t.t, state->begun));
    if (!isfinite(gained)) {
        blind = 1;
    } else {
        state->gained = gained;
        state->to_go = size - gained;
    }
    if (!(m->par.a_min > 0.0 && a < m->par.a_min)) {
        m->mem.thrust = t.t;
    }
    int64_t off = tick_since(t.t, t.dt > 0 ? -t.dt : 0);
    off = tick_since(off, t.dt > 0 ? -t.dt : 0);
    if (state->ended != 0 && state->ended <= t.t) {
        end(state, state->ended, BURN_COMPLETE, BURN_NOT_ABORTED);
        return;
    }
    state->ended = 0;
    if (blind) {
        end(state, t.t, BURN_ABORTED, BURN_BLIND);
    } else if (burnt >= m->par.longest) {
        end(state, t.t, BURN_ABORTED, BURN_TOO_LONG);
    } else if (!points(m, t)) {
        end(state, t.t, BURN_ABORTED, BURN_OFF_POINT);
    } else if (tick_seconds(tick_since(t.t, m->mem.thrust)) > m->par.settle) {
        end(state, t.t, BURN_ABORTED, BURN_NO_THRUST);
    } else if (state->to_go <= 0.0) {
        end(state, t.t, BURN_COMPLETE, BURN_NOT_ABORTED);
    } else if (a > 0.0) {
        const double left = state->to_go / a; /* [s] */
        if (left < tick_seconds(t.dt)) {
            /* open: not NaN, since what is gained, a sum with a, is finite here */
            state->ended = tick_since(t.t, -(int64_t)(left * 1e9 + 0.5)); /* before the next update */
            off = state->ended;
        }
    }
    for (uint32_t i = 0; i < THRUSTERS_MAX; i++) {
        if (m->par.engines_used >> i & 1u) {
            m->out.engines.off[i] = state->phase == BURN_RUNS ? off : t.t;
        }
    }
}

static void begin(BurnExecution *m, Tick t)
{
    BurnState *state = &m->out.state;
    state->phase = BURN_RUNS;
    state->begun = state->begun != 0 ? state->begun : t.t;
    m->mem.before = state->gained;
    m->mem.dv_N = m->in.sum.dv_N;
    m->mem.path = m->in.sum.path;
    m->mem.thrust = t.t;
    for (uint32_t i = 0; i < THRUSTERS_MAX; i++) {
        if (m->par.engines_used >> i & 1u) {
            m->out.engines.on[i] = t.t;
            m->out.engines.burns[i]++;
        }
    }
}

/* The command, whose change has this size [m/s], is executed from now on; what is left of a burn that went on before
 * must be known. */
static void take(BurnExecution *m, int64_t t, double size)
{
    BurnState *state = &m->out.state;
    const BurnState *kept = &m->in.kept;
    const int known = head_written(kept->head) && kept->phase > BURN_WAITS && kept->start == m->in.command.start;
    const int ended = known && (kept->phase == BURN_COMPLETE || kept->phase == BURN_ABORTED);
    m->mem.taken = m->in.command;
    state->phase = ended ? kept->phase : BURN_WAITS;
    state->abort = ended ? kept->abort : BURN_NOT_ABORTED;
    state->start = m->mem.taken.start;
    state->begun = known ? kept->begun : 0;
    state->ended = ended ? kept->ended : 0;
    state->gained = 0.0;
    if (known && isfinite(kept->gained)) {
        state->gained = kept->gained;
    } else if (known && !ended) {
        end(state, t, BURN_ABORTED, BURN_BLIND);
    }
    state->to_go = size - state->gained;
}

/* open state: to_go is finite where gained is, since a length is below 1.4e154 */
void burn_execution_update(BurnExecution *m, Tick t)
{
    BurnState *state = &m->out.state;
    const Head sum = m->in.sum.head;
    const int blind = !head_written(sum) || data_lost(t, sum.t, m->par.hold);
    const double size = vec_norm(m->in.command.dv_N);
    if (state->phase != BURN_RUNS && size > 0.0 && isfinite(size) && usable(&m->in.command) &&
        !same(&m->in.command, &m->mem.taken) && quality_optional(m->in.kept.head) == QUALITY_GOOD) {
        take(m, t.t, size);
    }
    const int resumes = state->begun != 0;
    const double late = tick_seconds(tick_since(t.t, resumes ? state->begun : m->mem.taken.start));
    const double latest = resumes ? m->par.longest : m->par.wait;
    if (state->phase == BURN_WAITS && late >= 0.0) {
        const int in_time = late <= latest || (!resumes && late < tick_seconds(t.dt));
        if (in_time && !blind && points(m, t)) {
            begin(m, t);
        } else if (late > latest) {
            end(state, t.t, BURN_ABORTED, blind ? BURN_BLIND : points(m, t) ? BURN_LATE : BURN_OFF_POINT);
        }
    }
    if (state->phase == BURN_RUNS) {
        run(m, t, blind);
    }
    if (state->phase == BURN_NONE) {
        return;
    }
    const Quality quality = quality_min(quality_through(sum), quality_optional(m->in.error.head));
    const Quality known = quality == QUALITY_NONE ? QUALITY_DEGRADED : quality;
    state->head = head_next(state->head, t.t, known);
    m->out.engines.head = head_next(m->out.engines.head, t.t, known);
}

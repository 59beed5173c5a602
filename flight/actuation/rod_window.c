/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/rod_window.h"

#include <string.h>

void rod_window_reset(RodWindow *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Counts the time that the rods were on, and gives the state anew where a period ends. */
static void count_time(RodWindow *m, Tick t, int64_t start, int on)
{
    RodWindowState *state = &m->out.state;
    const double elapsed = tick_seconds(tick_since(t.t, m->mem.begun));
    if (m->mem.running) {
        m->mem.on_time += m->mem.rods_on ? tick_seconds(t.dt) : 0.0;
    } else {
        const double share = m->par.period > 0 ? (double)m->par.on / (double)m->par.period : 0.0;
        state->share = share > 0.0 ? fm_clamp(share, 1.0) : 0.0;
    }
    if (!m->mem.running || start != m->mem.start) {
        state->share = m->mem.running && elapsed > 0.0 ? fm_clamp(m->mem.on_time / elapsed, 1.0) : state->share;
        m->mem.start = start;
        m->mem.begun = t.t;
        m->mem.on_time = 0.0;
    }
    if (!on && (m->mem.rods_on || !m->mem.running)) {
        m->mem.went_off = t.t;
        m->mem.were_off = 1u;
    } else if (on && !m->mem.rods_on) {
        m->mem.went_on = t.t;
    }
    m->mem.running = 1u;
    m->mem.rods_on = (uint32_t)on;
    state->on = (uint32_t)on;
    state->head = head_next(state->head, t.t, m->par.period > 0 ? QUALITY_GOOD : QUALITY_DEGRADED);
}

static void drive(RodWindow *m, Tick t, int on)
{
    const double none[RODS_MAX] = {0.0};
    const RodCommand *wanted = &m->in.wanted;
    RodCommand *command = &m->out.command;
    const int computed = head_written(wanted->head) && numbers_finite(wanted->dipole, RODS_MAX);
    const int64_t newest = computed ? data_time(wanted->head, t.t) : m->mem.newest;
    const int lost = head_written(command->head) && data_lost(t, newest, m->par.hold);
    if (!on || lost || computed) {
        const Quality quality = computed && !lost ? quality_through(wanted->head) : QUALITY_DEGRADED;
        command->head = head_next(command->head, t.t, quality);
        memcpy(command->dipole, on && !lost ? wanted->dipole : none, sizeof none);
        m->mem.newest = newest;
    } else {
        command->head = head_held(command->head);
    }
}

void rod_window_update(RodWindow *m, Tick t)
{
    const int64_t period = m->par.period, rest = period > 0 ? t.t % period : 0, phase = rest < 0 ? rest + period : rest;
    const int on = period > 0 && phase < m->par.on;
    count_time(m, t, tick_since(t.t, phase), on);
    drive(m, t, on);

    MeasuredField *field = &m->out.field;
    const Head head = m->in.measured.head;
    const int64_t taken_at = head_time(head, t.t);
    const int undisturbed = m->mem.were_off && tick_since(taken_at, m->mem.went_off) >= m->par.settle &&
                            taken_at > m->mem.went_off && (!on || taken_at <= m->mem.went_on);
    const int is_new = head_written(head) && (!head_written(field->head) || taken_at > field->head.t);
    if (is_new && undisturbed && vec_finite(m->in.measured.B_B)) {
        field->head = head_next(field->head, taken_at, quality_through(head));
        field->B_B = m->in.measured.B_B;
        m->out.state.taken++;
    }
    if (tick_since(t.t, field->head.t) > period) {
        field->head = head_held(field->head);
    }
}

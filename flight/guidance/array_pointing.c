/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/array_pointing.h"

#include <string.h>

#define TURN 6.283185307179586
#define NEAR_AXIS 0.01 /* part of the Sun's direction across the axis below which no angle is better than another */

void array_pointing_reset(ArrayPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* The nearest whole number. */
static int32_t whole(double x)
{
    /* open: no NaN, since angles of finite numbers are none */
    return (int32_t)(x < 0.0 ? x - 0.5 : x + 0.5);
}

/* [-] steps of the angle of the array i that is nearest to `here` [rad], within the range. */
static double nearest(const ArrayPointing *m, double theta, double here)
{
    double steps = (theta + TURN * (double)whole((here - theta) / TURN)) / m->par.step;
    const double end = m->par.range > 0 ? (double)m->par.range : 2147483647.0;
    if (steps > end && steps - TURN / m->par.step >= -end) {
        steps -= TURN / m->par.step;
    } else if (steps < -end && steps + TURN / m->par.step <= end) {
        steps += TURN / m->par.step;
    }
    return steps > end ? end : steps < -end ? -end : steps;
}

/* Whether the drive stands away from its target for too long. */
static int is_stuck(ArrayPointing *m, uint32_t i, double left, int64_t t, int moved)
{
    if (moved || left <= m->par.step + m->par.count || left < m->mem.left[i] - 0.5 * m->par.count) {
        m->mem.nearer[i] = t;
        m->mem.left[i] = left;
    }
    return m->par.persistence > 0 && tick_since(t, m->mem.nearer[i]) >= m->par.persistence;
}

/* The Sun's direction, for the array i: across its axis along the normal at the angle 0, and along axis x normal; what
 * is left of the normal's part. */
typedef struct Seen {
    double cosine, sine, along;
} Seen;

/* 0 where a number is not finite. */
static int see(const ArrayPointing *m, Seen seen[ARRAYS_MAX])
{
    const Vec3 s = m->in.sun.s_B;
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t i = 0; i < m->par.n && i < ARRAYS_MAX; i++) {
        const Vec3 axis = vec_unit(m->par.axes_B[i]), normal = vec_unit(m->par.normals_B[i]);
        const double along = vec_dot(axis, normal) * vec_dot(axis, s);
        const Vec3 parts = vec3(vec_dot(normal, s) - along, vec_dot(axis, vec_cross(normal, s)), along);
        if (!vec_finite(parts)) {
            return 0;
        }
        seen[i] = (Seen){parts.v[0], parts.v[1], parts.v[2]};
    }
    return 1;
}

static void point(ArrayPointing *m, uint32_t i, int64_t t, int first, Seen sun)
{
    int32_t *target = &m->out.command.target[i];
    const double cosine = sun.cosine, sine = sun.sine;
    const double here = m->par.count * (double)m->in.drive.position[i];
    if (first) {
        *target = whole(nearest(m, here, here));
    }
    const double wanted = nearest(m, fm_atan2(sine, cosine), here);
    const int known = m->in.sun.head.quality == QUALITY_GOOD && sine * sine + cosine * cosine > NEAR_AXIS * NEAR_AXIS;
    const int off = fabs(wanted - (double)*target) * m->par.step > m->par.dead_band;
    int moved = first;
    if (known && (off || first)) {
        const int32_t next = whole(wanted);
        moved = moved || next != *target;
        *target = next;
    }
    const double left = fabs(m->par.step * (double)*target - here);
    m->out.state.stuck |= is_stuck(m, i, left, t, moved) ? 1u << i : 0u;
    /* The normal turned to `here`: its part along the axis stays, that across it turns. */
    const double seen = sun.along + fm_cos(here) * cosine + fm_sin(here) * sine;
    m->out.state.off[i] = fm_acos(seen > 1.0 ? 1.0 : seen < -1.0 ? -1.0 : seen);
}

/* open state: a sum of three finite parts may be infinite, and is then 1 or -1, but is no NaN */
void array_pointing_update(ArrayPointing *m, Tick t)
{
    ArrayDriveCommand *command = &m->out.command;
    ArrayPointingState *state = &m->out.state;
    const Quality quality = quality_min(quality_through(m->in.sun.head), quality_through(m->in.drive.head));
    Seen seen[ARRAYS_MAX];
    if (quality == QUALITY_NONE || !see(m, seen)) {
        command->head = head_held(command->head);
        state->head = head_held(state->head);
        return;
    }
    const int first = !head_written(command->head);
    state->stuck = 0u;
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t i = 0; i < m->par.n && i < ARRAYS_MAX; i++) {
        point(m, i, t.t, first, seen[i]);
    }
    command->head = head_next(command->head, t.t, quality);
    state->head = head_next(state->head, t.t, quality);
}

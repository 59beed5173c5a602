/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/star_tracker_attitude.h"

#include <string.h>

#include "flight/math/attitude.h"

void star_tracker_attitude_reset(StarTrackerAttitude *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Returns whether the measurement can be used. */
static int measure(const StarTrackerAttitude *m, int64_t age, StarAttitude *out)
{
    const StarTrackerRegisters *r = &m->in.registers;
    const double full = (double)((INT64_C(1) << (m->par.bits - 1u)) - 1);
    const Quat q = {{(double)r->q[0], (double)r->q[1], (double)r->q[2], (double)r->q[3]}};
    const double norm = quat_norm(q);
    /* Half a count of each component is at most a count of the length. */
    if (fabs(norm - full) > 1.5 || (m->par.residual_max > 0u && r->residual > m->par.residual_max) ||
        (m->par.age_max > 0 && age > m->par.age_max)) {
        return 0;
    }
    const Vec3 sigma_SN = mrp_project(q.q[0], vec3(q.q[1], q.q[2], q.q[3]), norm);
    const Vec3 sigma_BN = mrp_compose(vec_neg(m->par.sigma_SB), sigma_SN);
    const Mat3 dcm_SB = mrp_to_dcm(m->par.sigma_SB);
    const double across = m->par.residual * (double)(r->residual > 0u ? r->residual : 1u);
    const double about = across * (m->par.about > 0.0 ? m->par.about : 1.0);
    Mat3 P_B;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double along = dcm_SB.m[2][i] * dcm_SB.m[2][j];
            P_B.m[i][j] = (i == j ? across * across : 0.0) + (about * about - across * across) * along;
        }
    }
    /* undecided: a guard; the parameters are within bounds */
    if (!vec_finite(sigma_BN) || !mat_finite(P_B)) {
        return 0;
    }
    out->sigma_BN = sigma_BN;
    out->P_B = P_B;
    return 1;
}

void star_tracker_attitude_update(StarTrackerAttitude *m, Tick t)
{
    const StarTrackerRegisters *r = &m->in.registers;
    StarAttitude *out = &m->out.attitude;
    StarTrackerState *state = &m->out.state;
    if (!head_written(r->head)) {
        out->head = head_held(out->head);
        state->head = head_held(state->head);
        return;
    }
    const int64_t measured = tag_time(r->time, m->par.tick, t.t);
    const int64_t age = tick_since(t.t, measured);
    state->tracks = r->tracks != 0u && (m->par.age_max == 0 || age <= m->par.age_max);
    if (r->counter > 0u && (m->mem.known == 0u || r->counter != m->mem.counter)) {
        m->mem.counter = r->counter;
        m->mem.known = 1u;
        if (measure(m, age, out)) {
            out->head = head_next(out->head, measured, quality_through(r->head));
        } else {
            state->refused++;
            out->head = head_held(out->head);
        }
    } else if (state->tracks == 0u) {
        out->head = head_held(out->head);
    }
    state->head = head_next(state->head, t.t, quality_through(r->head));
}

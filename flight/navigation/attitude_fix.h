/* SPDX-License-Identifier: Apache-2.0 */
/* What attitudes from directions share: which directions count, and what is reported of the result.
 *
 * Directions count that are of about the same time, and of which none was in an attitude before: an attitude is a
 * measurement of its own, whose error is independent of that of the last. Good ones count alone, if there are two. */
#ifndef FLIGHT_NAVIGATION_ATTITUDE_FIX_H
#define FLIGHT_NAVIGATION_ATTITUDE_FIX_H

#include "flight/math/attitude.h"
#include "flight/math/qr.h"
#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"

#define FIX_DIRECTIONS 4

/** The directions that count. */
typedef struct FixChoice {
    const SeenDirection *d[FIX_DIRECTIONS];
    uint32_t n;        /* how many */
    uint32_t together; /* with those that were in the last attitude */
    int64_t t;         /* [ns] of the newest */
    Quality quality;
} FixChoice;

/** Chooses among n directions those of at least a quality. */
static inline FixChoice fix_choose(const SeenDirection *const *all, int n, Quality least, int64_t now, Head last,
                                   double together)
{
    FixChoice c = {{all[0], all[0], all[0], all[0]}, 0u, 0u, INT64_MIN, QUALITY_GOOD};
    for (int i = 0; i < n; i++) {
        const Head head = all[i]->head;
        if (direction_speaks(all[i]) && head.quality >= least && head.t <= now && head.t > c.t) {
            c.t = head.t;
        }
    }
    for (int i = 0; i < n; i++) {
        const Head head = all[i]->head;
        if (direction_speaks(all[i]) && head.quality >= least && head.t <= now &&
            tick_seconds(tick_since(c.t, head.t)) <= together) {
            c.together++;
            if (!head_written(last) || head.t > last.t || last.t > now) {
                c.quality = quality_min(c.quality, quality_through(head));
                c.d[c.n++] = all[i];
            }
        }
    }
    return c;
}

/** Whether two directions of the body, and as known, are apart from each other and from the opposite. */
static inline int fix_apart(const SeenDirection *a, const SeenDirection *b, double least)
{
    const double seen = fm_sin(vec_angle(a->d_B, b->d_B)), known = fm_sin(vec_angle(a->d_N, b->d_N));
    return seen >= fm_sin(least) && known >= fm_sin(least);
}

/** x with P x = y, by the root of P. */
static inline Vec3 root_solve(Mat3 root, Vec3 y)
{
    double x[3];
    for (int i = 0; i < 3; i++) {
        x[i] = y.v[i];
        for (int k = 0; k < i; k++) {
            x[i] -= root.m[k][i] * x[k];
        }
        x[i] /= root.m[i][i];
    }
    for (int i = 2; i >= 0; i--) {
        for (int k = i + 1; k < 3; k++) {
            x[i] -= root.m[i][k] * x[k];
        }
        x[i] /= root.m[i][i];
    }
    return vec3(x[0], x[1], x[2]);
}

/** Adds k ((a . b) I - (a b^T + b a^T) / 2) to S, of which the upper half counts. */
static inline void add_across(Mat3 *S, double k, Vec3 a, Vec3 b)
{
    const double along = vec_dot(a, b);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            S->m[i][j] += k * ((i == j ? along : 0.0) - 0.5 * (a.v[i] * b.v[j] + b.v[i] * a.v[j]));
        }
    }
}

/** Writes an attitude, or holds it; `finding` is FIX_SOUND unless there is none. */
static inline void fix_write(StarAttitude *attitude, AttitudeFixState *state, const FixChoice *c, FixFinding finding,
                             Vec3 sigma_BN, Mat3 P_B, double misfit, double gate, int64_t now)
{
    const double std = fm_sqrt(P_B.m[0][0] + P_B.m[1][1] + P_B.m[2][2]);
    const Vec3 near_BN = mrp_short(sigma_BN);
    Quality quality = QUALITY_DEGRADED;
    if (finding == FIX_SOUND) {
        /* undecided: a guard; no inputs are known at which this alone is not finite */
        if (!(vec_finite(near_BN) && mat_finite(P_B) && isfinite(std) && isfinite(misfit))) {
            finding = FIX_INVALID;
        }
    }
    if (finding == FIX_SOUND) {
        quality = misfit <= gate * gate ? c->quality : QUALITY_DEGRADED;
        finding = misfit > gate * gate ? FIX_MISFIT : quality == QUALITY_GOOD ? FIX_SOUND : FIX_DEGRADED;
        *attitude = (StarAttitude){head_next(attitude->head, c->t, quality), near_BN, P_B};
        state->misfit = misfit;
        state->std = std;
        state->n = c->n;
        state->fixes++;
    } else {
        attitude->head = head_held(attitude->head);
        state->failed++;
    }
    state->finding = finding;
    state->head = head_next(state->head, now, quality);
}

#endif

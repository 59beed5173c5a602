/* SPDX-License-Identifier: Apache-2.0 */
/* What the attitude filters share: gyro rates between measured attitudes, late measurements, outliers, restarts.
 *
 * An estimate is one of a time, its horizon: that of the last measured attitude used. The gyro's rates since then are
 * kept, so a measured attitude takes effect at the time for which it was measured, whenever it arrives, and all rates
 * after it count again with the new bias. Where the rates become too many, the horizon goes on without a measurement.
 *
 * Over a span of rates the body turns by C, as if the bias b were exact. An error theta of the attitude and one of the
 * bias become
 *     theta' = C theta - J db,   J' = C_k J + G_k over each step k,   G_k = integral of exp(-[omega x] s) ds,
 * with white noise on the rate (rate_noise) and on the derivative of the bias (bias_walk), which add over a span T
 *     rate_noise T + bias_walk T^3 / 3,   -bias_walk M,   bias_walk T,
 * with M the integral of J over the times at which the span could begin. T^3 / 3 is exact for a body at rest, and
 * otherwise a little too large.
 *
 * A covariance P is kept as a root U, P = U^T U: it is never indefinite. Prediction and measurement are
 * orthogonal reductions of rows (flight/math/qr.h).
 * Sources: F. L. Markley, "Attitude error representations for Kalman filtering", JGCD 26(2), 2003; C. Forster et al.,
 * "On-manifold preintegration for real-time visual-inertial odometry", IEEE Transactions on Robotics 33(1), 2017. */
#ifndef FLIGHT_NAVIGATION_ATTITUDE_FILTER_H
#define FLIGHT_NAVIGATION_ATTITUDE_FILTER_H

#include <string.h>

#include "flight/math/attitude.h"
#include "flight/math/qr.h"
#include "flight/msg/attitude.h"
#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"

#define GYRO_HISTORY 32
#define PREDICTED_ROWS 19
#define VAGUE 0.1 /* [rad] an attitude that is worse is not corrected, which is linear: the filter begins anew */

/** An attitude and a bias, of a time. What a deviation of the attitude is, each filter defines. */
typedef struct AttitudeEstimate {
    int64_t t;         ///< [ns] of which it is
    Vec3 sigma_BN;     ///< [-]  the attitude
    Vec3 bias_B;       ///< [rad/s] bias of the gyro
    double root[6][6]; ///< [-]  root of the covariance of attitude and bias
} AttitudeEstimate;

/** The memory of an attitude filter. */
typedef struct AttitudeFilterMemory {
    AttitudeEstimate at;         ///< at the horizon
    int64_t seen;                ///< [ns] time of the last measured attitude that was looked at
    int64_t used;                ///< [ns] time of the last good one that was used
    int64_t now;                 ///< [ns] of the last update
    int64_t rejected_at;         ///< [ns] time of the last rejected attitude
    Vec3 rejected;               ///< [-] the last rejected attitude
    Vec3 measured;               ///< [-] the last measured attitude that was looked at
    uint32_t agree;              ///< [-] rejected attitudes in a row that agree with each other
    uint32_t running;            ///< [-] attitudes that fit since it began, up to `persistence`; 0: there is none
    uint32_t any;                ///< [-] 1 once a measured attitude was looked at
    uint32_t n;                  ///< [-] rates that are kept
    double misfit;               ///< [-] as AttitudeFilterState has it, and what follows
    uint32_t used_count;         ///< [-] used
    uint32_t rejected_count;     ///< [-] rejected
    uint32_t late_count;         ///< [-] late
    uint32_t restarts;           ///< [-] restarts
    int64_t times[GYRO_HISTORY]; ///< [ns] of the rates
    Vec3 rates[GYRO_HISTORY];    ///< [rad/s] as the gyro gave them
} AttitudeFilterMemory;

/** The parameters of an attitude filter: the group `par` of each. */
typedef struct AttitudeFilterParameters {
    double rate_noise;    ///< [rad^2/s] required, > 0: the square of the noise density of the rates
    double bias_walk;     ///< [rad^2/s^3] required, > 0: the variance that its bias gains per second
    double bias_std;      ///< [rad/s] required, > 0: standard deviation of its bias at the start
    double star_std;      ///< [rad] required, > 0: error of measured attitudes about each axis besides what they say
    double gate;          ///< [-] required, > 0: normalised innovation above which an attitude does not fit
    double hold;          ///< [s] required, > 0: longest gap between rates that can be bridged
    double coast;         ///< [s] required, > 0: longest time since the last measured attitude for a good result
    uint32_t persistence; ///< [-] required, > 0: attitudes that agree until it begins anew, or until it is good
    uint32_t spare;
} AttitudeFilterParameters;

/** How the body turns over a span of time. */
typedef struct GyroSpan {
    Vec3 sigma; /* of the attitude at the end relative to that at the start */
    Mat3 C, J, M;
    double T;
    double beyond; /* [rad] about each axis, what the rate may have changed since the last one that is kept */
} GyroSpan;

/** What distinguishes the filters. */
typedef struct AttitudeFilterKind {
    /* theta = to_turn x of a deviation x of the attitude, and back */
    Mat3 (*to_turn)(Vec3 sigma);
    Mat3 (*from_turn)(Vec3 sigma);
    /* The deviations of the estimate at the end of the span, as rows, except noise; how many they are. */
    int (*predict)(AttitudeEstimate *e, const GyroSpan *span, double (*rows)[6]);
    Vec3 (*innovation)(Vec3 measured, Vec3 sigma);
    void (*correct)(AttitudeEstimate *e, Vec3 dx);
} AttitudeFilterKind;

static inline Mat3 mat_sum(double a, Mat3 A, double b, Mat3 B)
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            A.m[i][j] = a * A.m[i][j] + b * B.m[i][j];
        }
    }
    return A;
}

/** One more step of dt [s] at a constant rate. */
static inline void span_add(GyroSpan *span, Vec3 omega, double dt)
{
    const Vec3 phi = vec_scale(dt, omega);
    const double phi2 = vec_norm2(phi);
    double c1 = 0.5 - phi2 * (1.0 / 24.0 - phi2 * (1.0 / 720.0 - phi2 / 40320.0));
    double c2 = 1.0 / 6.0 - phi2 * (1.0 / 120.0 - phi2 * (1.0 / 5040.0 - phi2 / 362880.0));
    if (phi2 >= 0.01) {
        double s, c;
        const double angle = fm_sqrt(phi2);
        fm_sincos(angle, &s, &c);
        c1 = (1.0 - c) / phi2;
        c2 = (1.0 - s / angle) / phi2;
    }
    const double x = phi.v[0], y = phi.v[1], z = phi.v[2];
    const double d = 1.0 - c2 * phi2;
    const Mat3 G = {{{dt * (d + c2 * x * x), dt * (c2 * x * y + c1 * z), dt * (c2 * x * z - c1 * y)},
                     {dt * (c2 * x * y - c1 * z), dt * (d + c2 * y * y), dt * (c2 * y * z + c1 * x)},
                     {dt * (c2 * x * z + c1 * y), dt * (c2 * y * z - c1 * x), dt * (d + c2 * z * z)}}};
    const Vec3 sigma = mrp_turn(phi);
    const Mat3 C = mrp_to_dcm(sigma);
    span->M = mat_sum(1.0, mat_mul(C, span->M), span->T + 0.5 * dt, G);
    span->J = mat_sum(1.0, mat_mul(C, span->J), 1.0, G);
    span->sigma = mrp_compose(sigma, span->sigma);
    span->T += dt;
}

/** The kept rate at a time in steps from one to the next, along straight lines; at the ends they go on. */
static inline Vec3 rate_between(const AttitudeFilterMemory *mem, uint32_t next, int64_t from, int64_t to)
{
    /* undecided: no horizon is before the first rate that is kept; a guard of the array */
    if (next == 0u || next >= mem->n) {
        /* undecided: as above */
        return mem->rates[next == 0u ? 0u : mem->n - 1u];
    }
    const int64_t begin = mem->times[next - 1u];
    const double whole = tick_seconds(tick_since(mem->times[next], begin));
    const double middle = 0.5 * (tick_seconds(tick_since(from, begin)) + tick_seconds(tick_since(to, begin)));
    const Vec3 a = mem->rates[next - 1u], b = mem->rates[next];
    return vec_add(a, vec_scale(middle / whole, vec_sub(b, a)));
}

/** The turn from one time to another by the rates that are kept, of which there is one at least. */
static inline GyroSpan span_of(const AttitudeFilterMemory *mem, Vec3 bias_B, int64_t from, int64_t to)
{
    GyroSpan span;
    memset(&span, 0, sizeof span);
    for (uint32_t next = 0u; next <= mem->n && from < to; next++) {
        const int64_t end = next < mem->n && mem->times[next] < to ? mem->times[next] : to;
        if (end > from) {
            const Vec3 rate = rate_between(mem, next, from, end);
            span_add(&span, vec_sub(rate, bias_B), tick_seconds(tick_since(end, from)));
            from = end;
        }
    }
    span.C = mrp_to_dcm(span.sigma);
    const int64_t last = mem->times[mem->n - 1u];
    if (to > last && mem->n > 1u) {
        const double t = tick_seconds(tick_since(to, last)),
                     dt = tick_seconds(tick_since(last, mem->times[mem->n - 2u]));
        span.beyond = 0.5 * t * t / dt * vec_norm(vec_sub(mem->rates[mem->n - 1u], mem->rates[mem->n - 2u]));
    }
    return span;
}

static inline void rows_set(double *row, Vec3 attitude, Vec3 bias)
{
    memcpy(row, attitude.v, sizeof attitude.v);
    memcpy(row + 3, bias.v, sizeof bias.v);
}

/** The deviations at the end of a span for those at its begin, theta' = C theta - J db, in place. */
static inline void rows_turn(double (*rows)[6], int n, const GyroSpan *span)
{
    for (int i = 0; i < n; i++) {
        const Vec3 theta = vec3(rows[i][0], rows[i][1], rows[i][2]);
        const Vec3 db = vec3(rows[i][3], rows[i][4], rows[i][5]);
        rows_set(rows[i], vec_sub(mat_vec(span->C, theta), mat_vec(span->J, db)), db);
    }
}

/** Deviations of the attitude, each replaced by a linear function of it. */
static inline void rows_map(double (*rows)[6], int n, Mat3 map)
{
    for (int i = 0; i < n; i++) {
        const Vec3 x = mat_vec(map, vec3(rows[i][0], rows[i][1], rows[i][2]));
        memcpy(rows[i], x.v, sizeof x.v);
    }
}

/** Six rows of noise, with theta for the attitude. */
static inline void rows_noise(double (*rows)[6], const GyroSpan *span, const AttitudeFilterParameters *par)
{
    const double T = span->T;
    const double white = fm_sqrt(par->rate_noise * T + par->bias_walk * T * T * T / 12.0 + span->beyond * span->beyond);
    const double walk = T > 0.0 ? fm_sqrt(par->bias_walk / T) : 0.0;
    memset(rows, 0, 6 * sizeof *rows);
    for (int i = 0; i < 3; i++) {
        rows_set(rows[i], vec_scale(-walk, vec3(span->M.m[0][i], span->M.m[1][i], span->M.m[2][i])), vec3(0, 0, 0));
        rows[i][3 + i] = walk * T;
        rows[3 + i][i] = white;
    }
}

static inline void copy_rate(AttitudeFilterMemory *mem, uint32_t to, uint32_t from)
{
    mem->times[to] = mem->times[from];
    const Vec3 rate = mem->rates[from];
    mem->rates[to] = rate;
}

/** Move the horizon. */
static inline void horizon_go(AttitudeFilterMemory *mem, const AttitudeFilterKind *kind, int64_t t,
                              const AttitudeFilterParameters *par)
{
    double rows[PREDICTED_ROWS][6];
    const GyroSpan span = span_of(mem, mem->at.bias_B, mem->at.t, t);
    const int n = kind->predict(&mem->at, &span, rows);
    rows_noise(rows + n, &span, par);
    rows_map(rows + n, 6, kind->from_turn(mem->at.sigma_BN));
    qr_reduce(&rows[0][0], n + 6, 6);
    memcpy(mem->at.root, rows, sizeof mem->at.root);
    if (mem->agree > 0u && mem->rejected_at < t) {
        mem->rejected = mrp_compose(span_of(mem, mem->at.bias_B, mem->rejected_at, t).sigma, mem->rejected);
        mem->rejected_at = t;
    }
    mem->at.t = t;
    if (mem->n > 2u) {
        const uint32_t last = mem->n - 2u; /* two are left: how the rate changes */
        uint32_t kept = 0u;
        /*@ loop unroll 30; */
        for (uint32_t i = 0u; i < last; i++) {
            if (mem->times[i + 2u] > t) {
                copy_rate(mem, kept, i);
                kept++;
            }
        }
        copy_rate(mem, kept, last);
        copy_rate(mem, kept + 1u, last + 1u);
        mem->n = kept + 2u;
    }
}

/** Keep one more rate. */
static inline void keep_rate(AttitudeFilterMemory *mem, const AttitudeFilterKind *kind, const GyroRate *gyro,
                             const AttitudeFilterParameters *par)
{
    const uint32_t half = GYRO_HISTORY / 2;
    if (mem->n == GYRO_HISTORY && mem->running != 0u && mem->at.t < mem->times[half]) {
        horizon_go(mem, kind, mem->times[half], par);
    }
    if (mem->n >= GYRO_HISTORY) {
        mem->n = GYRO_HISTORY - half;
        memmove(mem->times, mem->times + half, mem->n * sizeof *mem->times);
        memmove(mem->rates, mem->rates + half, mem->n * sizeof *mem->rates);
    }
    mem->times[mem->n] = gyro->head.t;
    mem->rates[mem->n] = gyro->omega_BN_B;
    mem->n++;
}

/** Begin with a measured attitude. The bias stays, for what it is worth. */
static inline void begin_at(AttitudeFilterMemory *mem, const AttitudeFilterKind *kind, const StarAttitude *stars,
                            Mat3 root, const AttitudeFilterParameters *par)
{
    mem->at.t = stars->head.t;
    mem->at.sigma_BN = mrp_short(stars->sigma_BN);
    memset(mem->at.root, 0, sizeof mem->at.root);
    for (int i = 0; i < 3; i++) {
        memcpy(mem->at.root[i], root.m[i], sizeof root.m[i]);
        mem->at.root[3 + i][3 + i] = par->bias_std;
    }
    rows_map(mem->at.root, 3, kind->from_turn(mem->at.sigma_BN));
    mem->running = 1u;
    mem->agree = 0u;
    mem->used = stars->head.quality == QUALITY_GOOD ? stars->head.t : INT64_MIN;
}

/** Whether rejected attitudes agree with each other for long enough that the estimate must be wrong. A repeated one, to
 *  the last digit, is that of a stuck star tracker: it agrees with nothing. */
static inline int all_agree(AttitudeFilterMemory *mem, const StarAttitude *stars, int repeated, Mat3 root,
                            const AttitudeFilterParameters *par)
{
    int agrees = 0;
    if (mem->agree > 0u && !repeated) {
        const GyroSpan span = span_of(mem, mem->at.bias_B, mem->rejected_at, stars->head.t);
        const Vec3 expected = mrp_compose(span.sigma, mem->rejected);
        double variance = 3.0 * (par->bias_std * par->bias_std * span.T * span.T + par->rate_noise * span.T);
        for (int i = 0; i < 3; i++) {
            variance += 2.0 * (root.m[0][i] * root.m[0][i] + root.m[1][i] * root.m[1][i] + root.m[2][i] * root.m[2][i]);
        }
        const Vec3 apart = vec_scale(4.0, mrp_relative(stars->sigma_BN, expected));
        agrees = vec_norm2(apart) <= par->gate * par->gate * variance;
    }
    mem->agree = repeated ? 0u : agrees ? mem->agree + 1u : 1u;
    mem->rejected = stars->sigma_BN;
    mem->rejected_at = stars->head.t;
    return mem->agree >= par->persistence;
}

/** Use a measured attitude at the horizon, which is of its time. 0: it does not fit. */
static inline int measure(AttitudeEstimate *e, const AttitudeFilterKind *kind, Vec3 measured, Mat3 root, double gate,
                          double *misfit)
{
    double A[9][9], dx[6];
    const Mat3 map = kind->from_turn(e->sigma_BN);
    for (int i = 0; i < 3; i++) {
        const Vec3 row = mat_vec(map, vec3(root.m[i][0], root.m[i][1], root.m[i][2]));
        memcpy(A[i], row.v, sizeof row.v);
    }
    for (int i = 0; i < 6; i++) {
        memcpy(A[3 + i], e->root[i], 3 * sizeof(double));
    }
    *misfit = root_measure(A, e->root, kind->innovation(measured, e->sigma_BN), gate * gate, dx);
    if (!(*misfit <= gate * gate)) {
        return 0;
    }
    e->bias_B = vec_add(e->bias_B, vec3(dx[3], dx[4], dx[5]));
    kind->correct(e, vec3(dx[0], dx[1], dx[2]));
    return 1;
}

/** [rad^2] About all three axes. */
static inline double attitude_variance(const AttitudeEstimate *e, const AttitudeFilterKind *kind)
{
    const Mat3 map = kind->to_turn(e->sigma_BN);
    double sum = 0.0;
    for (int i = 0; i < 6; i++) {
        sum += vec_norm2(mat_vec(map, vec3(e->root[i][0], e->root[i][1], e->root[i][2])));
    }
    return sum;
}

static inline int estimate_finite(const AttitudeEstimate *e)
{
    double sum = 0.0; /* neither infinite nor NaN if all are finite and none is huge */
    for (int i = 0; i < 36; i++) {
        sum += fm_abs(e->root[i / 6][i % 6]);
    }
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return isfinite(sum) && vec_finite(e->sigma_BN) && vec_finite(e->bias_B);
}

/** Look at a measured attitude that is new. */
static inline void look_at(AttitudeFilterMemory *mem, const AttitudeFilterKind *kind, const StarAttitude *stars,
                           const AttitudeFilterParameters *par)
{
    Mat3 P = mat_sum(0.5, stars->P_B, 0.5, mat_transpose(stars->P_B));
    for (int i = 0; i < 3; i++) {
        P.m[i][i] += par->star_std * par->star_std;
    }
    const Mat3 root = mat_root(P);
    const int64_t t = stars->head.t;
    const int repeated = vec_norm2(vec_sub(stars->sigma_BN, mem->measured)) == 0.0;
    mem->measured = stars->sigma_BN;
    mem->seen = t;
    mem->any = 1u;
    if (!mat_finite(root) || !vec_finite(stars->sigma_BN)) {
        mem->rejected_count++;
        return;
    }
    const int64_t oldest = mem->running != 0u ? mem->at.t : mem->times[0];
    if (t < oldest) {
        mem->late_count++;
        return;
    }
    if (mem->running != 0u) {
        /* The estimate goes to the time of the measured attitude only if it fits. */
        AttitudeFilterMemory there = *mem;
        horizon_go(&there, kind, t, par);
        const double measured = P.m[0][0] + P.m[1][1] + P.m[2][2];
        const int vague = attitude_variance(&there.at, kind) > VAGUE * VAGUE + 4.0 * measured;
        const int fits = measure(&there.at, kind, stars->sigma_BN, root, par->gate, &there.misfit);
        there.misfit = mem->misfit = isfinite(there.misfit) ? there.misfit : 0.0;
        /* undecided: a guard; no inputs are known at which this alone is not finite */
        if (!vague && fits && estimate_finite(&there.at)) {
            *mem = there;
            mem->agree = 0u;
            mem->used = stars->head.quality == QUALITY_GOOD ? t : mem->used;
            mem->used_count++;
            mem->running += mem->running < par->persistence ? 1u : 0u;
            return;
        }
        mem->rejected_count += vague ? 0u : 1u;
        if (!vague && !all_agree(mem, stars, repeated, root, par)) {
            return;
        }
        mem->restarts++;
    }
    begin_at(mem, kind, stars, root, par);
    mem->used_count++;
}

/** The estimate now. */
static inline void estimate_now(const AttitudeFilterMemory *mem, const AttitudeFilterKind *kind, int64_t t,
                                const AttitudeFilterParameters *par, NavAttitude *attitude, AttitudeFilterState *state)
{
    double rows[12][6];
    const GyroSpan span = span_of(mem, mem->at.bias_B, mem->at.t, t);
    memcpy(rows, mem->at.root, sizeof mem->at.root);
    rows_map(rows, 6, kind->to_turn(mem->at.sigma_BN));
    rows_turn(rows, 6, &span);
    rows_noise(rows + 6, &span, par);
    attitude->sigma_BN = mrp_short(mrp_compose(span.sigma, mem->at.sigma_BN));
    attitude->omega_BN_B = vec_sub(mem->rates[mem->n - 1u], mem->at.bias_B);
    state->bias_B = mem->at.bias_B;
    state->misfit = mem->misfit;
    state->used = mem->used_count;
    state->rejected = mem->rejected_count;
    state->late = mem->late_count;
    state->restarts = mem->restarts;
    for (int j = 0; j < 6; j++) {
        double sum = 0.0;
        for (int i = 0; i < 12; i++) {
            sum += rows[i][j] * rows[i][j];
        }
        (j < 3 ? &state->attitude_std : &state->bias_std)->v[j % 3] = fm_sqrt(sum);
    }
}

static inline int result_finite(const NavAttitude *attitude, const AttitudeFilterState *state)
{
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return vec_finite(attitude->sigma_BN) && vec_finite(attitude->omega_BN_B) && vec_finite(state->bias_B) &&
           vec_finite(state->attitude_std) && vec_finite(state->bias_std);
}

/** One update of a filter. */
static inline void attitude_filter_update(AttitudeFilterMemory *mem, const AttitudeFilterKind *kind,
                                          const AttitudeFilterParameters *par, const GyroRate *gyro,
                                          const StarAttitude *stars, Tick t, NavAttitude *attitude,
                                          AttitudeFilterState *state)
{
    AttitudeFilterMemory next = *mem;
    NavAttitude result = *attitude;
    AttitudeFilterState is = *state;
    /* open: n is GYRO_HISTORY at most: keep_rate(), which alone adds a rate, makes room first; widening forgets it */
    const int64_t newest = next.n > 0u ? next.times[next.n - 1u] : INT64_MIN;
    const int fresh = gyro_speaks(gyro) && gyro->head.t <= t.t && gyro->head.t > newest &&
                      tick_seconds(tick_since(t.t, gyro->head.t)) <= par->hold;
    const int64_t since = fresh ? gyro->head.t : t.t;
    if (t.t < next.now || (next.n > 0u && tick_seconds(tick_since(since, newest)) > par->hold)) {
        /* The clock went back, or nothing says how the body turned meanwhile. */
        next.any = t.t < next.now ? 0u : next.any;
        next.restarts += next.running != 0u ? 1u : 0u;
        next.running = next.agree = next.n = 0u;
    }
    next.now = t.t;
    if (fresh) {
        keep_rate(&next, kind, gyro, par);
    }
    /* An attitude of a time to come waits: it would move `seen` on, and all earlier attitudes would count as old. */
    if (next.n > 0u && stars->head.quality >= QUALITY_DEGRADED && stars->head.t <= t.t &&
        (next.any == 0u || stars->head.t > next.seen)) {
        look_at(&next, kind, stars, par);
    }
    int known = 0;
    if (next.n > 0u && next.running != 0u) {
        known = 1;
        estimate_now(&next, kind, t.t, par, &result, &is);
        const int old = next.running < par->persistence || next.used != next.seen ||
                        tick_seconds(tick_since(t.t, next.used)) > par->coast;
        const Quality quality = old || gyro->head.quality != QUALITY_GOOD ? QUALITY_DEGRADED : QUALITY_GOOD;
        result.head = head_next(attitude->head, t.t, quality);
        is.head = head_next(state->head, t.t, quality);
    }
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (result_finite(&result, &is) && estimate_finite(&next.at)) {
        *mem = next; /* also while it waits for a first attitude, or for a rate */
        if (known) {
            *attitude = result;
            *state = is;
            return;
        }
    }
    attitude->head = head_held(attitude->head);
    state->head = head_held(state->head);
}

#endif

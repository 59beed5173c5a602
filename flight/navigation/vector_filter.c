/* SPDX-License-Identifier: Apache-2.0 */
/* The prediction is that of attitude_filter.h; the magnetometer's bias walks by itself.
 * A measurement goes number by number: of y = h . x with the variance r, and the rows u of the root U,
 *     v = U h,   s = v . v + r,   k = U^T v / s,   U' = U - v k^T / (1 + sqrt(r / s)),   misfit = (y - h . x)^2 / s.
 * The attitude then turns by the estimated x, e; of the turn that is left, seen from there, x' = x - e - (e x x) / 2.
 * With the doubled covariance of the start, P = 2 diag(P_start, P_bias), no correlation of the two makes more. */
#include "flight/navigation/vector_filter.h"

#include "flight/navigation/attitude_filter.h"
#include "flight/navigation/attitude_fix.h"

#define LOST 0.3         /* [rad] about all axes: an attitude that is worse is not corrected, which is linear */
#define VAGUE_START 0.15 /* [rad] about all axes: it does not begin with one that is worse */
#define FIELD 3          /* the source that is the field */

void vector_filter_reset(VectorFilter *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* A measurement of any source. */
typedef struct Seen {
    Head head;
    Vec3 as_B, as_N;
    double noise;
} Seen;

static Vec3 three(const double *at)
{
    return vec3(at[0], at[1], at[2]);
}

/* By a constant rate, with its bias. */
static void predict(VectorEstimate *e, Vec3 rate, double beyond, int64_t t, const VectorFilter *m)
{
    double six[15][6], rows[18][9] = {{0.0}};
    AttitudeFilterParameters noise;
    GyroSpan span;
    memset(&noise, 0, sizeof noise);
    memset(&span, 0, sizeof span);
    noise.rate_noise = m->par.rate_noise;
    noise.bias_walk = m->par.bias_walk;
    span_add(&span, vec_sub(rate, e->bias_B), tick_seconds(tick_since(t, e->t)));
    span.C = mrp_to_dcm(span.sigma);
    span.beyond = beyond;
    for (int i = 0; i < 9; i++) {
        memcpy(six[i], e->root[i], sizeof six[i]);
        memcpy(rows[i], e->root[i], sizeof rows[i]);
    }
    rows_turn(six, 9, &span);
    rows_noise(six + 9, &span, &noise);
    for (int i = 0; i < 15; i++) {
        memcpy(rows[i], six[i], sizeof six[i]);
    }
    for (int i = 0; i < 3; i++) {
        rows[15 + i][6 + i] = fm_sqrt(m->par.field_walk * span.T);
    }
    qr_reduce(&rows[0][0], 18, 9);
    memcpy(e->root, rows, sizeof e->root);
    e->sigma_BN = mrp_short(mrp_compose(span.sigma, e->sigma_BN));
    e->t = t;
}

/* One number y = h . x, with the variance r. */
static double take(VectorEstimate *e, double x[9], const double h[9], double y, double r)
{
    double v[9] = {0.0}, k[9] = {0.0}, s = r;
    for (int i = 0; i < 9; i++) {
        for (int j = 0; j < 9; j++) {
            v[i] += e->root[i][j] * h[j];
        }
        s += v[i] * v[i];
        y -= h[i] * x[i];
    }
    for (int i = 0; i < 9; i++) {
        for (int j = 0; j < 9; j++) {
            k[j] += e->root[i][j] * v[i] / s;
        }
    }
    const double part = 1.0 / (1.0 + fm_sqrt(r / s));
    for (int i = 0; i < 9; i++) {
        for (int j = 0; j < 9; j++) {
            e->root[i][j] -= part * v[i] * k[j];
        }
        x[i] += k[i] * y;
    }
    return y * y / s;
}

/* The component of a measurement along an axis, w - b = b x x + C bias, and its misfit. */
static double take_along(VectorEstimate *e, double x[9], Vec3 axis, Vec3 w, Vec3 b, Mat3 bias, double noise)
{
    double h[9] = {0.0};
    const Vec3 turn = vec_cross(axis, b), drift = mat_transpose_vec(bias, axis);
    memcpy(h, turn.v, sizeof turn.v);
    memcpy(h + 6, drift.v, sizeof drift.v);
    return take(e, x, h, vec_dot(axis, vec_sub(w, b)), noise * noise);
}

/* The turn of the body from a time to that of the estimate. */
static Vec3 turn_since(const VectorFilter *m, int64_t t)
{
    return vec_scale(tick_seconds(tick_since(m->mem.at.t, t)), vec_sub(m->mem.rate, m->mem.at.bias_B));
}

/* Corrects the estimate. Its misfit. */
static double correct(VectorEstimate *e, const Seen *seen, int source, Vec3 turn)
{
    const Mat3 since = mrp_to_dcm(mrp_turn(turn)), none = {{{0.0}}};
    const Vec3 b = mat_vec(mrp_to_dcm(e->sigma_BN), seen->as_N);
    double x[9] = {0.0}, misfit = 0.0;
    if (source == FIELD) {
        const Vec3 w = mat_vec(since, vec_sub(seen->as_B, e->field_bias_B));
        for (int i = 0; i < 3; i++) {
            Vec3 axis = vec3(0.0, 0.0, 0.0);
            axis.v[i] = 1.0;
            misfit += take_along(e, x, axis, w, b, since, seen->noise);
        }
    } else {
        /* Across b, as far as the angle between both; where they are opposite, to any side. */
        const Vec3 d = mat_vec(since, seen->as_B), side = vec_unit(vec_cross(b, vec_far_axis(b)));
        const Vec3 off = vec_sub(d, vec_scale(vec_dot(d, b), b));
        const double angle = vec_angle(d, b), length = vec_norm(off);
        const Vec3 w = vec_add(b, length > 0.0 ? vec_scale(angle / length, off) : vec_scale(angle, side));
        misfit += take_along(e, x, side, w, b, none, seen->noise);
        misfit += take_along(e, x, vec_unit(vec_cross(b, side)), w, b, none, seen->noise);
    }
    const Vec3 turned = three(x);
    for (int i = 0; i < 9; i++) {
        const Vec3 left = vec_sub(three(e->root[i]), vec_scale(0.5, vec_cross(turned, three(e->root[i]))));
        memcpy(e->root[i], left.v, sizeof left.v);
    }
    e->sigma_BN = mrp_short(mrp_compose(mrp_turn(turned), e->sigma_BN));
    e->bias_B = vec_add(e->bias_B, three(x + 3));
    e->field_bias_B = vec_add(e->field_bias_B, three(x + 6));
    return misfit;
}

/* Standard deviations of three of the states. */
static Vec3 std_of(const VectorEstimate *e, int first)
{
    Vec3 std;
    for (int j = 0; j < 3; j++) {
        double sum = 0.0;
        for (int i = 0; i < 9; i++) {
            sum += e->root[i][first + j] * e->root[i][first + j];
        }
        std.v[j] = fm_sqrt(sum);
    }
    return std;
}

static int sound(const VectorEstimate *e)
{
    double sum = 0.0; /* neither infinite nor NaN if all are finite and none is huge */
    for (int i = 0; i < 81; i++) {
        sum += fm_abs(e->root[i / 9][i % 9]);
    }
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return isfinite(sum) && vec_finite(e->sigma_BN) && vec_finite(e->bias_B) && vec_finite(e->field_bias_B);
}

static int lost(const VectorFilter *m)
{
    return m->mem.running == 0u || !(vec_norm2(std_of(&m->mem.at, 0)) <= LOST * LOST);
}

/* Process a measurement, if it is good and new. */
static void process(VectorFilter *m, const Seen *seen, int source, int64_t now)
{
    const int64_t t = seen->head.t;
    if (seen->head.quality != QUALITY_GOOD || t > now || t <= m->mem.seen[source]) {
        return;
    }
    const int repeated = vec_norm2(vec_sub(seen->as_B, m->mem.last[source])) == 0.0;
    m->mem.seen[source] = t;
    m->mem.last[source] = seen->as_B;
    if (!(tick_seconds(tick_since(m->mem.at.t, t)) <= m->par.age_max)) {
        m->mem.late++;
        return;
    }
    if (repeated) {
        m->mem.rejected[source]++;
        return;
    }
    VectorEstimate there = m->mem.at;
    const int usable = seen->noise > 0.0 && vec_finite(seen->as_B) && vec_finite(seen->as_N);
    const double misfit = usable ? correct(&there, seen, source, turn_since(m, t)) : INFINITY;
    m->mem.misfit[source] = isfinite(misfit) ? misfit : 0.0;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (misfit <= m->par.gate * m->par.gate && sound(&there)) {
        m->mem.at = there;
        m->mem.used[source]++;
        m->mem.doubt[source] = 0u;
        m->mem.running += m->mem.running <= m->par.persistence ? 1u : 0u;
    } else {
        m->mem.rejected[source]++;
        m->mem.doubt[source] += usable && m->mem.doubt[source] < m->par.persistence ? 1u : 0u;
    }
}

/* Whether a source is in doubt. */
static int doubtful(const VectorFilter *m)
{
    int any = 0;
    for (int i = 0; i < VECTOR_SOURCES; i++) {
        any = any || m->mem.doubt[i] >= m->par.persistence;
    }
    return any;
}

/* Nothing is known of the biases. */
static void forget(VectorFilter *m)
{
    memset(m->mem.at.root, 0, sizeof m->mem.at.root);
    for (int i = 0; i < 3; i++) {
        m->mem.at.root[3 + i][3 + i] = m->par.bias_std;
        m->mem.at.root[6 + i][6 + i] = fm_sqrt(2.0) * m->par.field_bias_std;
    }
    m->mem.at.bias_B = m->mem.at.field_bias_B = vec3(0.0, 0.0, 0.0);
}

/* Whether the estimate is not that of another attitude, whose covariance has a root of these rows. */
static int contradicts(const VectorFilter *m, Vec3 sigma_BN, const Vec3 rows[3])
{
    const Vec3 apart = vec_scale(4.0, mrp_relative(sigma_BN, m->mem.at.sigma_BN));
    Mat3 P = {{{0.0}}};
    for (int i = 0; i < 12; i++) {
        const Vec3 row = i < 3 ? rows[i] : three(m->mem.at.root[i - 3]);
        for (int k = 0; k < 9; k++) {
            P.m[k / 3][k % 3] += row.v[k / 3] * row.v[k % 3];
        }
    }
    return !(vec_dot(apart, root_solve(mat_root(P), apart)) <= m->par.gate * m->par.gate);
}

/* Begins with the attitude of `start`, if it is good and new, and if there is none or it is in doubt. */
static void begin(VectorFilter *m, int64_t now)
{
    const StarAttitude *start = &m->in.start;
    const int64_t t = start->head.t;
    if (start->head.quality != QUALITY_GOOD || t > now || (m->mem.any != 0u && t <= m->mem.begun)) {
        return;
    }
    m->mem.any = 1u;
    m->mem.begun = t;
    const Mat3 root = mat_root(mat_sum(0.5, start->P_B, 0.5, mat_transpose(start->P_B)));
    Vec3 rows[3];
    const Vec3 turn = turn_since(m, t);
    const Vec3 sigma_BN = mrp_compose(mrp_turn(turn), start->sigma_BN);
    const double variance = start->P_B.m[0][0] + start->P_B.m[1][1] + start->P_B.m[2][2];
    if (!mat_finite(root) || !vec_finite(sigma_BN) || !(variance <= VAGUE_START * VAGUE_START) ||
        !(tick_seconds(tick_since(m->mem.at.t, t)) <= m->par.age_max)) {
        return;
    }
    const Mat3 since = mrp_to_dcm(mrp_turn(turn));
    for (int i = 0; i < 3; i++) { /* at the time of the estimate, and doubled */
        rows[i] = mat_vec(since, vec_scale(fm_sqrt(2.0), three(root.m[i])));
    }
    if (!lost(m)) {
        if (!doubtful(m) || !contradicts(m, sigma_BN, rows)) {
            return;
        }
        forget(m);
    }
    m->mem.restarts += m->mem.running != 0u ? 1u : 0u;
    double biases[9][6];
    for (int i = 0; i < 9; i++) {
        memcpy(biases[i], m->mem.at.root[i] + 3, sizeof biases[i]);
    }
    qr_reduce(&biases[0][0], 9, 6);
    memset(m->mem.at.root, 0, sizeof m->mem.at.root);
    for (int i = 0; i < 3; i++) {
        memcpy(m->mem.at.root[i], rows[i].v, sizeof rows[i].v);
    }
    for (int i = 0; i < 6; i++) {
        memcpy(m->mem.at.root[3 + i] + 3, biases[i], sizeof biases[i]);
    }
    m->mem.at.sigma_BN = mrp_short(sigma_BN);
    m->mem.running = 1u;
    for (int i = 0; i < VECTOR_SOURCES; i++) { /* what the start may be made from does not count again */
        m->mem.seen[i] = m->mem.known[i] == 0u || m->mem.seen[i] < t ? t : m->mem.seen[i];
        m->mem.known[i] = 1u;
        m->mem.doubt[i] = 0u;
    }
}

/* Takes a new rate, up to whose time the estimate goes. */
static void turn_on(VectorFilter *m, int64_t now)
{
    const GyroRate *gyro = &m->in.gyro;
    const int64_t t = gyro->head.t;
    const int fresh = gyro_speaks(gyro) && t <= now && (m->mem.rates == 0u || t > m->mem.at.t) &&
                      tick_seconds(tick_since(now, t)) <= m->par.hold;
    if (m->mem.rates > 0u && tick_seconds(tick_since(fresh ? t : now, m->mem.at.t)) > m->par.hold) {
        m->mem.restarts += m->mem.running != 0u ? 1u : 0u;
        m->mem.running = 0u; /* nothing says how the body turned meanwhile */
    }
    if (!fresh) {
        return;
    }
    if (m->mem.rates == 0u) {
        forget(m);
        m->mem.at.t = t;
    } else {
        m->mem.before = m->mem.rate;
        m->mem.before_t = m->mem.at.t;
        predict(&m->mem.at, vec_scale(0.5, vec_add(m->mem.rate, gyro->omega_BN_B)), 0.0, t, m);
    }
    m->mem.rate = gyro->omega_BN_B;
    m->mem.rates += m->mem.rates < 2u ? 1u : 0u;
}

/* The estimate now, by the last rate and as far as it may have changed. */
static VectorEstimate estimate_at(const VectorFilter *m, int64_t now)
{
    VectorEstimate e = m->mem.at;
    if (now > e.t) {
        const double T = tick_seconds(tick_since(now, e.t)), dt = tick_seconds(tick_since(e.t, m->mem.before_t));
        const double change = vec_norm(vec_sub(m->mem.rate, m->mem.before));
        predict(&e, m->mem.rate, m->mem.rates > 1u ? 0.5 * T * T / dt * change : 0.0, now, m);
    }
    return e;
}

/* 0: a number of the outputs would not be finite. */
static int write(VectorFilter *m, const VectorEstimate *e, int64_t now)
{
    VectorFilterState *state = &m->out.state;
    const Vec3 std = std_of(e, 0), bias_std = std_of(e, 3), field_bias_std = std_of(e, 6);
    const Vec3 rate = vec_sub(m->mem.rate, e->bias_B);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (!vec_finite(std) || !vec_finite(bias_std) || !vec_finite(field_bias_std) || !vec_finite(rate)) {
        return 0;
    }
    const int good = m->mem.running > m->par.persistence && !doubtful(m) && std.v[0] <= m->par.good &&
                     std.v[1] <= m->par.good && std.v[2] <= m->par.good;
    const Quality quality = good && m->in.gyro.head.quality == QUALITY_GOOD ? QUALITY_GOOD : QUALITY_DEGRADED;
    m->out.attitude = (NavAttitude){head_next(m->out.attitude.head, now, quality), e->sigma_BN, rate};
    state->head = head_next(state->head, now, quality);
    state->bias_B = e->bias_B;
    state->field_bias_B = e->field_bias_B;
    state->attitude_std = std;
    state->bias_std = bias_std;
    state->field_bias_std = field_bias_std;
    memcpy(state->misfit, m->mem.misfit, sizeof state->misfit);
    memcpy(state->used, m->mem.used, sizeof state->used);
    memcpy(state->rejected, m->mem.rejected, sizeof state->rejected);
    state->late = m->mem.late;
    state->restarts = m->mem.restarts;
    return 1;
}

void vector_filter_update(VectorFilter *m, Tick t)
{
    VectorFilter next = *m;
    const SeenDirection *const directions[] = {&m->in.first, &m->in.second, &m->in.third};
    if (t.t < next.mem.now) { /* the clock went back */
        next.mem.restarts += next.mem.running != 0u ? 1u : 0u;
        next.mem.rates = next.mem.running = next.mem.any = 0u;
        memset(next.mem.known, 0, sizeof next.mem.known);
        memset(next.mem.doubt, 0, sizeof next.mem.doubt);
    }
    next.mem.now = t.t;
    turn_on(&next, t.t);
    if (next.mem.rates > 0u && tick_seconds(tick_since(t.t, next.mem.at.t)) <= m->par.hold) {
        begin(&next, t.t);
    }
    for (int i = 0; i < FIELD && !lost(&next); i++) {
        const SeenDirection *d = directions[i];
        const Seen seen = {d->head, vec_unit(d->d_B), vec_unit(d->d_N), direction_speaks(d) ? d->std : 0.0};
        process(&next, &seen, i, t.t);
    }
    if (!lost(&next) && m->par.field_noise > 0.0 && m->in.known_field.head.quality == QUALITY_GOOD) {
        const Seen seen = {m->in.field.head, m->in.field.B_B, m->in.known_field.B_N, m->par.field_noise};
        process(&next, &seen, FIELD, t.t);
    }
    const VectorEstimate e = estimate_at(&next, t.t);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (sound(&next.mem.at) && sound(&e) && vec_finite(next.mem.rate)) {
        m->mem = next.mem; /* also while it waits for rates or a start */
        /* undecided: a guard, as in write() */
        if (next.mem.running != 0u && write(m, &e, t.t)) {
            return;
        }
    }
    m->out.attitude.head = head_held(m->out.attitude.head);
    m->out.state.head = head_held(m->out.state.head);
}

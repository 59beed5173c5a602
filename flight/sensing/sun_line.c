/* SPDX-License-Identifier: Apache-2.0 */
/* Over a step dt, with C the turn by (omega_gyro + b) dt, errors become
 *     dd' = C dd + dt d x db   with d in the middle,   db' = db.
 * A cosine is linear in d, so that an error of any size does it no harm; only the turn is not. With the variance a^2
 * across d, what is left out of it, (db + noise) x dd and the arc by which d falls short of its tangent, grows as fast
 * as a and reaches a^2. 2 a^2 (a std(b) + rate_noise) dt, in all directions, bounds the growth of its mean square.
 * The lit cosines are reduced to three measurements H dd = y of unit variance: rows (n_i, c_i - n_i . d) / std_i become
 * [H y] by an orthogonal reduction, which loses nothing. H may be singular. */
#include "flight/sensing/sun_line.h"

#include <string.h>

#include "flight/math/attitude.h"
#include "flight/math/qr.h"

void sun_line_reset(SunLine *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* [rad] An estimate that is worse has no part in an update. */
#define VAGUE 0.5
/* [rad] Standard deviation of a guess: too large for it to be known, or good. */
#define GUESS 0.25
/* [-] Standard deviations from which on all lit sensors together are too bright or too dark. */
#define BRIGHT 3.0

static Vec3 part(const double *three)
{
    return vec3(three[0], three[1], three[2]);
}

/* The root of the sum of the variances of both axes across s; with s zero, of all three. */
static double across(const SunLine *m, Vec3 s, int first)
{
    double sum = 0.0;
    for (int i = 0; i < 6; i++) {
        const Vec3 u = part(&m->mem.root[i][first]);
        const double along = vec_dot(s, u);
        sum += vec_norm2(u) - along * along;
    }
    return fm_sqrt(sum > 0.0 ? sum : 0.0);
}

/* The standard deviation of n . d. */
static double spread(const SunLine *m, Vec3 n)
{
    double sum = 0.0;
    for (int i = 0; i < 6; i++) {
        const double along = vec_dot(n, part(m->mem.root[i]));
        sum += along * along;
    }
    return fm_sqrt(sum);
}

static void predict(SunLine *m, Vec3 gyro_B, double dt)
{
    double rows[16][6] = {{0.0}};
    const Vec3 phi = vec_scale(dt, vec_add(gyro_B, m->mem.b_B));
    const Mat3 C = mrp_to_dcm(mrp_turn(phi));
    const Vec3 d = mat_vec(C, m->mem.d_B);
    const Vec3 middle = vec_scale(0.5, vec_add(m->mem.d_B, d));
    const double white = fm_sqrt(m->par.rate_noise * dt + m->par.walk * dt * dt * dt / 12.0);
    const double walk = fm_sqrt(m->par.walk * dt);
    const Vec3 s = vec_unit(m->mem.d_B);
    const double along = spread(m, s), a = across(m, s, 0), b = across(m, vec3(0.0, 0.0, 0.0), 3);
    const double bent = a * fm_sqrt(2.0 * dt * (a * b + m->par.rate_noise));
    for (int i = 0; i < 6; i++) {
        const Vec3 db = part(&m->mem.root[i][3]);
        const Vec3 dd = vec_add(mat_vec(C, part(m->mem.root[i])), vec_scale(dt, vec_cross(middle, db)));
        memcpy(rows[i], dd.v, sizeof dd.v);
        memcpy(rows[i] + 3, db.v, sizeof db.v);
    }
    for (int i = 0; i < 3; i++) {
        double axis[3] = {0.0, 0.0, 0.0};
        axis[i] = 1.0;
        const Vec3 side = vec_cross(middle, part(axis));
        const Vec3 drifted = vec_scale(0.5 * dt * walk, side), turned = vec_scale(white, side);
        memcpy(rows[6 + i], drifted.v, sizeof drifted.v);
        rows[6 + i][3 + i] = walk;
        memcpy(rows[9 + i], turned.v, sizeof turned.v);
        rows[12 + i][i] = bent;
    }
    if (m->mem.young > 0u && m->mem.used >= 3u && m->par.length > along) {
        const Vec3 brighter = vec_scale(fm_sqrt(m->par.length * m->par.length - along * along), d);
        memcpy(rows[15], brighter.v, sizeof brighter.v);
    }
    m->mem.young -= m->mem.young > 0u && m->mem.used > 0u ? 1u : 0u;
    qr_reduce(&rows[0][0], 16, 6);
    memcpy(m->mem.root, rows, sizeof m->mem.root);
    m->mem.d_B = d;
}

/* Cosines that fit, as rows of unit variance. How many lit sensors did not fit. */
static uint32_t choose(const SunLine *m, const SunCosines *cosines, double (*rows)[4], uint32_t *used)
{
    uint32_t misfits = 0u;
    *used = 0u;
    for (uint32_t i = 0u; i < cosines->n && i < SUN_SENSORS_MAX; i++) {
        const Vec3 n = cosines->axes_B[i];
        const double std = m->par.noise / fm_sqrt(cosines->weight[i]);
        const double rest = cosines->cosine[i] - vec_dot(n, m->mem.d_B);
        const double limit = m->par.gate * (std + spread(m, n));
        if ((cosines->lit >> i & 1u) == 0u) {
            continue;
        }
        if (!(std > 0.0) || !(fm_abs(rest) <= limit)) {
            misfits++;
            continue;
        }
        const double row[4] = {n.v[0] / std, n.v[1] / std, n.v[2] / std, rest / std};
        memcpy(rows[*used], row, sizeof row);
        *used += 1u;
    }
    return misfits;
}

static void correct(SunLine *m, double (*rows)[4], int n)
{
    qr_reduce(&rows[0][0], n < 4 ? 4 : n, 4); /* rows that are not there are zero */

    double A[9][9] = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}, dx[6];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++) {
            A[3 + i][j] = vec_dot(part(rows[j]), part(m->mem.root[i]));
        }
    }
    root_measure(A, m->mem.root, vec3(rows[0][3], rows[1][3], rows[2][3]), INFINITY, dx);
    m->mem.d_B = vec_add(m->mem.d_B, part(dx));
    m->mem.b_B = vec_add(m->mem.b_B, part(dx + 3));
}

/* The guess; or any direction: d is zero, with the covariance of a unit vector of which nothing is known. b stays. */
static void begin(SunLine *m)
{
    const Head head = m->in.guess.head;
    const int guessed = head.quality >= QUALITY_DEGRADED && vec_finite(m->in.guess.s_B) &&
                        tick_seconds(tick_since(m->mem.t, head.t)) <= m->par.hold;
    double b[6][3];
    for (int i = 0; i < 6; i++) {
        memcpy(b[i], &m->mem.root[i][3], sizeof b[i]);
    }
    qr_reduce(&b[0][0], 6, 3);
    m->mem.d_B = guessed ? m->in.guess.s_B : vec3(0.0, 0.0, 0.0);
    memset(m->mem.root, 0, sizeof m->mem.root);
    for (int i = 0; i < 3; i++) {
        m->mem.root[i][i] = guessed ? GUESS : fm_sqrt(1.0 / 3.0);
        memcpy(&m->mem.root[3 + i][3], b[i], sizeof b[i]);
    }
    m->mem.misfits = 0u;
    m->mem.young = m->par.persistence;
}

/* Nothing is known of b either. */
static void forget(SunLine *m)
{
    m->mem.b_B = vec3(0.0, 0.0, 0.0);
    memset(m->mem.root, 0, sizeof m->mem.root);
    for (int i = 0; i < 3; i++) {
        m->mem.root[3 + i][3 + i] = m->par.rate_std;
    }
    m->mem.running = 1u;
}

/* Whether |d| is 1, or what is not known of d may make it 1. */
static int length_fits(const SunLine *m)
{
    const double length = vec_norm(m->mem.d_B), gate = m->par.gate;
    const Vec3 s = vec_unit(m->mem.d_B);
    const double a = gate * across(m, s, 0);
    return fm_abs(length - 1.0) <= gate * (m->par.length + m->par.noise + spread(m, s)) + 0.5 * a * a;
}

/* Whether sensors that fit, one by one, are not too bright or too dark together: the Sun is not partly hidden. */
static int bright(const SunLine *m, double (*rows)[4], uint32_t n)
{
    Vec3 sum = vec3(0.0, 0.0, 0.0);
    double more = 0.0, variance = 0.0;
    for (uint32_t i = 0u; i < n; i++) {
        const double cosine = vec_dot(part(rows[i]), m->mem.d_B);
        more += cosine * rows[i][3];
        variance += cosine * cosine;
        sum = vec_add(sum, vec_scale(cosine, part(rows[i])));
    }
    const double of_d = spread(m, sum);
    return more * more <= BRIGHT * BRIGHT * (variance + of_d * of_d);
}

/* Use the lit sensors. 0: most do not fit, or all are too dark, or what they see has not the length 1. */
static int use(SunLine *m, const SunCosines *cosines, uint32_t *misfits)
{
    double rows[SUN_SENSORS_MAX][4] = {{0.0}};
    *misfits = choose(m, cosines, rows, &m->mem.used);
    if (*misfits > m->mem.used || !bright(m, rows, m->mem.used)) {
        return 0;
    }
    correct(m, rows, (int)m->mem.used);
    return length_fits(m);
}

/* How good the estimate can be by what the lit sensors say of it. */
static Quality see(SunLine *m, const SunCosines *cosines)
{
    const uint32_t n = cosines->n < SUN_SENSORS_MAX ? cosines->n : SUN_SENSORS_MAX;
    if ((cosines->lit & ((1u << n) - 1u)) == 0u) {
        return QUALITY_GOOD;
    }
    SunLine next = *m;
    uint32_t misfits;
    const double a = across(m, vec_unit(m->mem.d_B), 0);
    const int known = m->mem.running != 0u && a * a <= m->par.noise && a <= VAGUE && length_fits(m);
    if (m->mem.running == 0u) {
        forget(&next);
    }
    if (!known) {
        begin(&next);
    }
    const int fits = use(&next, cosines, &misfits);
    next.mem.rejected += misfits;
    if (fits || !known) {
        next.mem.misfits = 0u;
        *m = next;
        return misfits > 0u && next.mem.used < 3u ? QUALITY_DEGRADED : QUALITY_GOOD;
    }
    m->mem.rejected = next.mem.rejected;
    m->mem.misfits++;
    if (m->mem.misfits >= m->par.persistence) {
        forget(&next);
        begin(&next);
        if (use(&next, cosines, &misfits) && across(&next, vec_unit(next.mem.d_B), 0) <= VAGUE) {
            next.mem.restarts++;
            *m = next;
            return QUALITY_GOOD;
        }
    }
    return QUALITY_DEGRADED;
}

void sun_line_update(SunLine *m, Tick t)
{
    SunLine next = *m;
    const GyroRate *gyro = &m->in.gyro;
    const SunCosines *cosines = &m->in.cosines;
    Quality quality = quality_optional(gyro->head);
    if (gyro_speaks(gyro)) {
        next.mem.gyro_B = gyro->omega_BN_B;
        next.mem.turned = data_time(gyro->head, t.t);
        next.mem.any_gyro = 1u;
    }
    const double age = next.mem.any_gyro != 0u ? tick_seconds(tick_since(t.t, next.mem.turned)) : 0.0;
    const int turning = age <= m->par.hold; /* by a rate that is known */
    quality = quality_min(quality, age > 0.0 ? QUALITY_DEGRADED : QUALITY_GOOD);
    next.mem.running = turning ? next.mem.running : 0u;
    const double dt = tick_seconds(tick_since(t.t, next.mem.t));
    if (next.mem.running != 0u && dt > 0.0 && dt <= m->par.hold) {
        predict(&next,
                m->mem.any_gyro != 0u ? vec_scale(0.5, vec_add(m->mem.gyro_B, next.mem.gyro_B)) : next.mem.gyro_B, dt);
    } else if (dt != 0.0) {
        next.mem.running = 0u;
    }
    next.mem.t = t.t;
    next.mem.used = 0u;
    if (turning && cosines->head.quality >= QUALITY_DEGRADED &&
        tick_seconds(tick_since(t.t, data_time(cosines->head, t.t))) <= m->par.hold &&
        (next.mem.running == 0u || cosines->head.t != next.mem.seen)) {
        next.mem.seen = cosines->head.t;
        quality = quality_min(quality, quality_min(see(&next, cosines), quality_through(cosines->head)));
    } else {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }

    const Vec3 s = vec_unit(next.mem.d_B);
    const double a = across(&next, s, 0), b = across(&next, s, 3), std = a / vec_norm(next.mem.d_B);
    const int with_gyro = next.mem.any_gyro != 0u;
    const double rate_std =
        fm_sqrt(b * b + (with_gyro && t.dt > 0 ? 2.0 * m->par.rate_noise / tick_seconds(t.dt) : 0.0));
    const Vec3 omega = vec_add(next.mem.gyro_B, next.mem.b_B);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (next.mem.running == 0u || !(a <= 1.0) || !vec_finite(s) || !vec_finite(omega) || !isfinite(std) ||
        !isfinite(rate_std)) {
        m->mem.restarts += m->mem.running;
        m->mem.running = 0u;
        m->mem.t = t.t;
        m->out.heading.head = head_held(m->out.heading.head);
        if (turning && gyro_speaks(gyro)) {
            m->out.rate = (GyroRate){head_next(m->out.rate.head, t.t, QUALITY_DEGRADED), gyro->omega_BN_B};
        } else {
            m->out.rate.head = head_held(m->out.rate.head);
        }
        m->out.state.head = head_held(m->out.state.head);
        return;
    }
    /* One rate does not say how often there are rates, and that is how noisy they are. */
    if (!(std <= m->par.good) || !length_fits(&next) || (with_gyro && t.dt <= 0)) {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }
    if (next.mem.used == 0u) {
        quality = quality_min(quality, m->out.heading.head.quality); /* the dark clears no doubt */
    }
    m->mem = next.mem;
    m->out.heading = (SunHeading){head_next(m->out.heading.head, t.t, quality), s};
    m->out.rate = (GyroRate){head_next(m->out.rate.head, t.t, quality), omega};
    m->out.state = (SunLineState){
        head_next(m->out.state.head, t.t, quality), std, rate_std, m->mem.used, m->mem.rejected, m->mem.restarts, 0u};
}

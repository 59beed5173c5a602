/* SPDX-License-Identifier: Apache-2.0 */
/* Over a step dt, with C the turn by (omega_gyro + b) dt, errors become
 *     dd' = C dd + dt d x db   with d in the middle,   db' = db.
 * The lit cosines are reduced to three measurements H dd = y of unit variance: rows (n_i, c_i - n_i . d) / std_i, and
 * one for the length, become [H y] by an orthogonal reduction, which loses nothing. H may be singular. */
#include "flight/sensing/sun_line.h"

#include <string.h>

#include "flight/math/attitude.h"
#include "flight/math/qr.h"

void sun_line_reset(SunLine *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static Vec3 part(const double *three)
{
    return vec3(three[0], three[1], three[2]);
}

static void predict(SunLine *m, double dt)
{
    double rows[12][6] = {{0.0}};
    const Vec3 phi = vec_scale(dt, vec_add(m->mem.gyro_B, m->mem.b_B));
    const Mat3 C = mrp_to_dcm(mrp_turn(phi));
    const Vec3 d = mat_vec(C, m->mem.d_B);
    const Vec3 middle = vec_scale(0.5, vec_add(m->mem.d_B, d));
    const double white = fm_sqrt(m->par.rate_noise * dt + m->par.walk * dt * dt * dt / 12.0);
    const double walk = fm_sqrt(m->par.walk * dt);
    for (int i = 0; i < 6; i++) {
        const Vec3 db = part(&m->mem.root[i][3]);
        const Vec3 dd = vec_add(mat_vec(C, part(m->mem.root[i])), vec_scale(dt, vec_cross(middle, db)));
        memcpy(rows[i], dd.v, sizeof dd.v);
        memcpy(rows[i] + 3, db.v, sizeof db.v);
    }
    for (int i = 0; i < 3; i++) {
        double axis[3] = {0.0, 0.0, 0.0};
        axis[i] = 1.0;
        const Vec3 across = vec_cross(middle, part(axis));
        const Vec3 drifted = vec_scale(0.5 * dt * walk, across), turned = vec_scale(white, across);
        memcpy(rows[6 + i], drifted.v, sizeof drifted.v);
        rows[6 + i][3 + i] = walk;
        memcpy(rows[9 + i], turned.v, sizeof turned.v);
    }
    qr_reduce(&rows[0][0], 12, 6);
    memcpy(m->mem.root, rows, sizeof m->mem.root);
    m->mem.d_B = d;
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
    const double length = vec_norm(m->mem.d_B);
    for (int j = 0; j < 3; j++) {
        rows[n][j] = m->mem.d_B.v[j] / (length * m->par.length);
    }
    rows[n][3] = (1.0 - length) / m->par.length;
    const int all = n + 1 < 4 ? 4 : n + 1; /* rows that are not there are zero */
    qr_reduce(&rows[0][0], all, 4);

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

/* Begin where the lit sensors look, with an error as large as theirs would be by one alone. 0: none is lit. */
static int begin(SunLine *m, const SunCosines *cosines)
{
    Vec3 sum = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0u; i < cosines->n && i < SUN_SENSORS_MAX; i++) {
        if ((cosines->lit >> i & 1u) != 0u) {
            sum = vec_add(sum, vec_scale(cosines->cosine[i], cosines->axes_B[i]));
        }
    }
    m->mem.d_B = vec_unit(sum);
    m->mem.b_B = vec3(0.0, 0.0, 0.0);
    memset(m->mem.root, 0, sizeof m->mem.root);
    for (int i = 0; i < 3; i++) {
        m->mem.root[i][i] = 0.7;
        m->mem.root[3 + i][3 + i] = m->par.rate_std;
    }
    m->mem.misfits = 0u;
    m->mem.running = vec_norm(m->mem.d_B) > 0.5 ? 1u : 0u;
    return m->mem.running != 0u;
}

static void see(SunLine *m, const SunCosines *cosines)
{
    double rows[SUN_SENSORS_MAX + 1][4] = {{0.0}};
    if (m->mem.running == 0u && !begin(m, cosines)) {
        return;
    }
    uint32_t misfits = choose(m, cosines, rows, &m->mem.used);
    m->mem.rejected += misfits;
    m->mem.misfits = misfits > m->mem.used ? m->mem.misfits + 1u : 0u;
    if (m->mem.misfits >= m->par.persistence) {
        m->mem.restarts++;
        memset(rows, 0, sizeof rows);
        if (!begin(m, cosines)) {
            return;
        }
        choose(m, cosines, rows, &m->mem.used);
    }
    if (m->mem.used > 0u) {
        correct(m, rows, (int)m->mem.used);
    }
}

/* Across the direction s: the root of the sum of the variances of both axes. */
static double across(const SunLine *m, Vec3 s, int first)
{
    double sum = 0.0;
    for (int i = 0; i < 6; i++) {
        sum += vec_norm2(vec_cross(s, part(&m->mem.root[i][first])));
    }
    return fm_sqrt(sum);
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
        predict(&next, dt);
    } else if (dt != 0.0) {
        next.mem.running = 0u;
    }
    next.mem.t = t.t;
    next.mem.used = 0u;
    if (turning && cosines->head.quality >= QUALITY_DEGRADED &&
        tick_seconds(tick_since(t.t, data_time(cosines->head, t.t))) <= m->par.hold &&
        (next.mem.running == 0u || cosines->head.t != next.mem.seen)) {
        next.mem.seen = cosines->head.t;
        see(&next, cosines);
        quality = quality_min(quality, quality_through(cosines->head));
    } else {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }

    const Vec3 s = vec_unit(next.mem.d_B);
    const double std = across(&next, s, 0) / vec_norm(next.mem.d_B), rate_std = across(&next, s, 3);
    const Vec3 omega = vec_add(next.mem.gyro_B, next.mem.b_B);
    const int finite = vec_finite(next.mem.d_B) && vec_finite(omega) && isfinite(std) && isfinite(rate_std);
    if (next.mem.running == 0u || !finite || !(std <= 1.0)) {
        m->mem.restarts += m->mem.running;
        m->mem.running = 0u;
        m->mem.t = t.t;
        m->out.heading.head = head_held(m->out.heading.head);
        m->out.rate.head = head_held(m->out.rate.head);
        m->out.state.head = head_held(m->out.state.head);
        return;
    }
    quality = std <= m->par.good ? quality : quality_min(quality, QUALITY_DEGRADED);
    m->mem = next.mem;
    m->out.heading = (SunHeading){head_next(m->out.heading.head, t.t, quality), s};
    m->out.rate = (GyroRate){head_next(m->out.rate.head, t.t, quality), omega};
    m->out.state = (SunLineState){
        head_next(m->out.state.head, t.t, quality), std, rate_std, m->mem.used, m->mem.rejected, m->mem.restarts, 0u};
}

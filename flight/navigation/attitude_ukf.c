/* SPDX-License-Identifier: Apache-2.0 */
/* A deviation of the attitude is one of sigma: theta = 4 B^-1 dsigma, with B of dsigma = B omega / 4. The points are
 * those of alpha = 1, kappa = 0, beta = 2: with the rows u of the root, sigma and bias +- sqrt(6) u, weighted 1/12, and
 * the centre, which counts 2 in the covariance alone. The measured attitude is linear in the state, and the innovation
 * is between sets that are near each other, so the unscented measurement is the linear one. */
#include "flight/navigation/attitude_ukf.h"

static Mat3 to_turn(Vec3 sigma)
{
    const double d = 1.0 + vec_norm2(sigma);
    return mat_sum(4.0 / (d * d), mat_transpose(mrp_rate_matrix(sigma)), 0.0, mat_identity());
}

static Mat3 from_turn(Vec3 sigma)
{
    return mat_sum(0.25, mrp_rate_matrix(sigma), 0.0, mat_identity());
}

/* Deviations of sigma as those of its shadow: d(-sigma / sigma.sigma). */
static Mat3 to_shadow(Vec3 sigma)
{
    const double s2 = vec_norm2(sigma);
    Mat3 S;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            S.m[i][j] = 2.0 * sigma.v[i] * sigma.v[j] / (s2 * s2) - (i == j ? 1.0 / s2 : 0.0);
        }
    }
    return S;
}

/* The short set, and the n deviations with it. */
static void shorten(AttitudeEstimate *e, double (*rows)[6], int n)
{
    if (vec_norm2(e->sigma_BN) > 1.0) {
        rows_map(rows, n, to_shadow(e->sigma_BN));
        e->sigma_BN = mrp_shadow(e->sigma_BN);
    }
}

static int predict(AttitudeEstimate *e, const GyroSpan *span, double (*rows)[6])
{
    const double spread = fm_sqrt(6.0);
    const Vec3 centre = mrp_compose(span->sigma, e->sigma_BN);
    Vec3 mean = vec3(0.0, 0.0, 0.0);
    for (int i = 0; i < 12; i++) {
        const double *u = e->root[i / 2];
        const double k = i % 2 == 0 ? spread : -spread;
        const Vec3 sigma = vec_add(e->sigma_BN, vec3(k * u[0], k * u[1], k * u[2]));
        const Vec3 db = vec3(k * u[3], k * u[4], k * u[5]);
        const Vec3 less = mrp_turn(vec_neg(mat_vec(span->J, db)));
        const Vec3 there = mrp_nearer(mrp_compose(less, mrp_compose(span->sigma, sigma)), centre);
        rows_set(rows[i], there, vec_scale(1.0 / fm_sqrt(12.0), db));
        mean = vec_add(mean, vec_scale(1.0 / 12.0, there));
    }
    for (int i = 0; i < 12; i++) {
        for (int j = 0; j < 3; j++) {
            rows[i][j] = (rows[i][j] - mean.v[j]) / fm_sqrt(12.0);
        }
    }
    rows_set(rows[12], vec_scale(fm_sqrt(2.0), vec_sub(centre, mean)), vec3(0.0, 0.0, 0.0));
    e->sigma_BN = mean;
    shorten(e, rows, 13);
    return 13;
}

static Vec3 innovation(Vec3 measured, Vec3 sigma)
{
    return vec_sub(mrp_nearer(measured, sigma), sigma);
}

static void correct(AttitudeEstimate *e, Vec3 dx)
{
    e->sigma_BN = vec_add(e->sigma_BN, dx);
    shorten(e, e->root, 6);
}

void attitude_ukf_reset(AttitudeUkf *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void attitude_ukf_update(AttitudeUkf *m, Tick t)
{
    const AttitudeFilterKind kind = {to_turn, from_turn, predict, innovation, correct};
    attitude_filter_update(&m->mem.filter, &kind, &m->par, &m->in.gyro, &m->in.stars, t, &m->out.attitude,
                           &m->out.state);
}

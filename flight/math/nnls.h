/* SPDX-License-Identifier: Apache-2.0 */
/* Least squares without negative numbers, for small problems. */
#ifndef FLIGHT_MATH_NNLS_H
#define FLIGHT_MATH_NNLS_H

#include <stdint.h>

#include "flight/math/elementary.h"

#define NNLS_ROWS 6
#define NNLS_COLUMNS 8

/** [-] The weight of the squared norm, as a part of the sum of all squared numbers of A. */
#define NNLS_RIDGE 2e-10

/** Columns a_i of A, of m rows. */
typedef struct Nnls {
    uint32_t m; /* 3 or NNLS_ROWS */
    uint32_t n; /* <= NNLS_COLUMNS */
    double a[NNLS_COLUMNS][NNLS_ROWS];
    double b[NNLS_ROWS];
} Nnls;

/* m is a parameter of all that follows, so that a compiler can unroll the loops for the one that counts. */
static inline double nnls_dot(const double *a, const double *b, uint32_t m)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < m; k++) {
        sum += a[k] * b[k];
    }
    return sum;
}

/* L D L^T = A_P A_P^T + ridge I, which has m rows however many columns there are; `inverse` is of D. */
typedef struct NnlsFactor {
    double L[NNLS_ROWS][NNLS_ROWS];
    double inverse[NNLS_ROWS];
} NnlsFactor;

static inline void nnls_factor(const Nnls *p, uint32_t m, uint32_t set, double ridge, NnlsFactor *f)
{
    for (uint32_t k = 0; k < m; k++) {
        for (uint32_t l = 0; l <= k; l++) {
            f->L[k][l] = 0.0;
        }
    }
    for (uint32_t i = 0; i < p->n; i++) {
        const double use = set >> i & 1u ? 1.0 : 0.0; /* of three rows, faster than a branch */
        if (m > 3u && use == 0.0) {
            continue;
        }
        for (uint32_t k = 0; k < m; k++) {
            for (uint32_t l = 0; l <= k; l++) {
                f->L[k][l] += use * p->a[i][k] * p->a[i][l];
            }
        }
    }
    for (uint32_t k = 0; k < m; k++) {
        f->inverse[k] = 1.0 / (f->L[k][k] + ridge);
        for (uint32_t i = m; i-- > k + 1u;) {
            const double part = f->L[i][k] * f->inverse[k];
            for (uint32_t l = k + 1u; l <= i; l++) {
                f->L[i][l] -= part * f->L[l][k];
            }
            f->L[i][k] = part;
        }
    }
}

/* y += (L D L^T)^-1 r */
static inline void nnls_step(const NnlsFactor *f, uint32_t m, const double *r, double *y)
{
    double s[NNLS_ROWS];
    for (uint32_t k = 0; k < m; k++) {
        s[k] = r[k] - nnls_dot(f->L[k], s, k);
    }
    for (uint32_t k = m; k-- > 0;) {
        s[k] *= f->inverse[k];
        for (uint32_t l = k + 1; l < m; l++) {
            s[k] -= f->L[l][k] * s[l];
        }
        y[k] += s[k];
    }
}

/* x_P = A_P^T y, at least 0, and r = b - A x. */
static inline void nnls_numbers(const Nnls *p, uint32_t m, uint32_t set, const double *y, double *x, double *r)
{
    for (uint32_t k = 0; k < m; k++) {
        r[k] = p->b[k];
    }
    for (uint32_t i = 0; i < p->n; i++) {
        const double z = set >> i & 1u ? nnls_dot(p->a[i], y, m) : 0.0;
        x[i] = z > 0.0 ? z : 0.0;
        for (uint32_t k = 0; k < m; k++) {
            r[k] -= p->a[i][k] * x[i];
        }
    }
}

static inline int nnls_search(const Nnls *p, uint32_t m, uint32_t *set, double *x, double *r)
{
    double size = 0.0;
    for (uint32_t i = 0; i < p->n; i++) {
        size += nnls_dot(p->a[i], p->a[i], m);
    }
    const double ridge = size > 0.0 ? NNLS_RIDGE * size : 1.0;
    uint32_t P = *set & ((1u << p->n) - 1u), fewest = NNLS_COLUMNS + 1, tries = 3;
    const int rounds = isfinite(size * nnls_dot(p->b, p->b, m)) ? 64 : 0;
    NnlsFactor f;
    for (int round = 0; round < rounds; round++) {
        double y[NNLS_ROWS] = {0.0};
        nnls_factor(p, m, P, ridge, &f);
        nnls_step(&f, m, p->b, y);
        /* The square of what rounding makes of z = 0. After 32 rounds the search goes round between sets, since the
         * ridge makes the rounding of y larger, up to 1e-6. */
        const double small = (round < 32 ? 1e-28 : 1e-12) * size * nnls_dot(y, y, m);
        uint32_t wrong = 0, count = 0, last = 0;
        for (uint32_t i = 0; i < p->n; i++) {
            const uint32_t bit = 1u << i;
            const double z = nnls_dot(p->a[i], y, m);
            const int bad = P & bit ? !(z > 0.0) : z > 0.0 && z * z > small;
            wrong |= bad ? bit : 0u;
            count += (uint32_t)bad;
            last = bad ? bit : last;
        }
        if (wrong == 0u) {
            for (uint32_t k = 0; k < m; k++) {
                r[k] = ridge * y[k];
            }
            nnls_step(&f, m, r, y);
            nnls_numbers(p, m, P, y, x, r);
            *set = P;
            return 1;
        }
        if (count < fewest) {
            fewest = count;
            tries = 3;
        } else if (tries > 0u) {
            tries--;
        }
        P ^= tries > 0u ? wrong : last;
    }
    *set = 0u;
    return 0;
}

/** The x >= 0 of least norm among those for which |A x - b| is least, and what is left, r = b - A x. `set` has a bit
 *  for each x > 0; the search begins with what it holds, so that a set which is right already costs one solution.
 *  Returns 1, or 0 if A or b is not finite or the search did not end: x is then no solution.
 *  With a ridge, which makes the least norm unique, x_P = A_P^T y, (A_P A_P^T + ridge I) y = b, and the conditions of
 *  Karush, Kuhn and Tucker are a_i . y > 0 for x_i > 0 and a_i . y <= 0 else. All x that break them change sides at
 *  once while that reduces their number, else the last one alone, which ends for every strictly convex problem (Murty;
 *  Portugal, Judice and Vicente 1994). A second step with the same factor, for ridge y, which the first one leaves of
 *  b, then takes the ridge's error out of A x. */
static inline int nnls(const Nnls *p, uint32_t *set, double *x, double *r)
{
    return p->m == 3u ? nnls_search(p, 3u, set, x, r) : nnls_search(p, NNLS_ROWS, set, x, r);
}

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Triangular square roots of symmetric matrices, for filters: a root U of P has P = U^T U, so that each of its rows is
 * a deviation, and rows below one another add their covariances. */
#ifndef FLIGHT_MATH_QR_H
#define FLIGHT_MATH_QR_H

#include <string.h>

#include "flight/math/vec.h"

#define QR_COLUMNS_MAX 9

/** Replaces A, rows by columns (at most QR_COLUMNS_MAX, and not more than rows), stored by rows, by the upper
 *  triangular R of A = Q R: R^T R = A^T A, and all below R is zero. By Householder's reflections: stable for A of any
 *  rank.
 *  Source: G. H. Golub, C. F. Van Loan, Matrix Computations, section 5.2. */
static inline void qr_reduce(double *A, int rows, int columns)
{
    for (int k = 0; k < columns; k++) {
        double norm2 = 0.0;
        for (int i = k; i < rows; i++) {
            norm2 += A[i * columns + k] * A[i * columns + k];
        }
        const double norm = fm_sqrt(norm2);
        const double a = A[k * columns + k];
        const double beta = 1.0 / (norm * (norm + fm_abs(a)));
        if (!(norm2 > 0.0) || isinf(beta)) {
            continue; /* the column is zero, or too small to have an inverse */
        }
        A[k * columns + k] = a > 0.0 ? a + norm : a - norm;
        double w[QR_COLUMNS_MAX] = {0.0};
        for (int i = k; i < rows; i++) {
            for (int j = k + 1; j < columns; j++) {
                w[j] += A[i * columns + k] * A[i * columns + j];
            }
        }
        for (int i = k; i < rows; i++) {
            const double v = beta * A[i * columns + k];
            for (int j = k + 1; j < columns; j++) {
                A[i * columns + j] -= v * w[j];
            }
            A[i * columns + k] = 0.0;
        }
        A[k * columns + k] = a > 0.0 ? -norm : norm;
    }
}

/** A measurement of three numbers y of a state of six, P = U^T U. The first three columns of A are the root r of the
 *  measurement's covariance, and below it H u for each row u of U; the function writes the others.
 *      [ r     0 ]   reduces to   [ S  K  ]
 *      [ U H^T U ]                [ 0  U' ],   e = S^-T innovation,   dx = K^T e
 *  Gives the misfit e . e and dx; up to the limit of the misfit, U becomes U'.
 *  Source: T. Kailath, A. H. Sayed, B. Hassibi, Linear Estimation, chapter 12. */
static inline double root_measure(double A[9][9], double U[6][6], Vec3 innovation, double limit, double dx[6])
{
    for (int i = 0; i < 3; i++) {
        memset(A[i] + 3, 0, sizeof U[i]);
    }
    for (int i = 0; i < 6; i++) {
        memcpy(A[3 + i] + 3, U[i], sizeof U[i]);
    }
    qr_reduce(&A[0][0], 9, 9);
    double e[3], misfit = 0.0;
    for (int i = 0; i < 3; i++) {
        e[i] = innovation.v[i];
        for (int k = 0; k < i; k++) {
            e[i] -= A[k][i] * e[k];
        }
        e[i] /= A[i][i];
        misfit += e[i] * e[i];
    }
    for (int j = 0; j < 6; j++) {
        dx[j] = A[0][3 + j] * e[0] + A[1][3 + j] * e[1] + A[2][3 + j] * e[2];
    }
    for (int i = 0; i < 6 && misfit <= limit; i++) {
        memcpy(U[i], A[3 + i] + 3, sizeof U[i]);
    }
    return misfit;
}

/** The upper triangular U of P = U^T U (Cholesky), of which the upper half counts. Not finite unless P is positive
 *  definite. */
static inline Mat3 mat_root(Mat3 P)
{
    Mat3 U = {{{0.0}}};
    U.m[0][0] = fm_sqrt(P.m[0][0]);
    U.m[0][1] = P.m[0][1] / U.m[0][0];
    U.m[0][2] = P.m[0][2] / U.m[0][0];
    U.m[1][1] = fm_sqrt(P.m[1][1] - U.m[0][1] * U.m[0][1]);
    U.m[1][2] = (P.m[1][2] - U.m[0][1] * U.m[0][2]) / U.m[1][1];
    U.m[2][2] = fm_sqrt(P.m[2][2] - U.m[0][2] * U.m[0][2] - U.m[1][2] * U.m[1][2]);
    return U;
}

#endif

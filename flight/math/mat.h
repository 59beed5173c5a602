/* SPDX-License-Identifier: Apache-2.0 */
/* The pseudo-inverse of a symmetric matrix of three, in closed form. */
#ifndef FLIGHT_MATH_MAT_H
#define FLIGHT_MATH_MAT_H

#include "flight/math/vec.h"

/** An eigenvalue below this part of the largest counts as zero. In terms of A in S = A A^T: a
 *  direction that A reaches with less than a thousandth of its strength elsewhere. */
#define MAT_RANK_TOLERANCE 1e-6

/** S^+ of a symmetric positive-semidefinite S, with its numerical rank.
 *  T = S / tr S has the invariants 1, e2 = tr adj T, e3 = det T. By Cayley and Hamilton
 *      rank 3: T^+ = adj T / e3;   rank 2: T^+ = (I - T) / e2 - adj T / e2^2;   rank 1: T^+ = T.
 *  With eigenvalues 1 >= a >= b, the ratios tested, e2 / 1 and e3 / e2, are a and b to within a
 *  small factor. */
static inline Mat3 mat_sym_pinv(Mat3 S, int *rank)
{
    double trace = S.m[0][0] + S.m[1][1] + S.m[2][2];
    if (!(trace > 0.0)) {
        *rank = 0;
        return (Mat3){{{0.0}}};
    }
    double k = 1.0 / trace;
    double xx = k * S.m[0][0], yy = k * S.m[1][1], zz = k * S.m[2][2];
    double xy = k * S.m[0][1], xz = k * S.m[0][2], yz = k * S.m[1][2];
    double adj_xx = yy * zz - yz * yz, adj_xy = xz * yz - xy * zz;
    double adj_yy = xx * zz - xz * xz, adj_xz = xy * yz - xz * yy;
    double adj_zz = xx * yy - xy * xy, adj_yz = xy * xz - xx * yz;
    double e2 = adj_xx + adj_yy + adj_zz;
    double e3 = xx * adj_xx + xy * adj_xy + xz * adj_xz;

    double of_I = 0.0, of_T = 0.0, of_adj = 0.0;
    if (!(e2 > MAT_RANK_TOLERANCE)) {
        *rank = 1;
        of_T = k;
    } else if (!(e3 > MAT_RANK_TOLERANCE * e2)) {
        *rank = 2;
        of_I = k / e2;
        of_T = -of_I;
        of_adj = -of_I / e2;
    } else {
        *rank = 3;
        of_adj = k / e3;
    }
    double p_xy = of_T * xy + of_adj * adj_xy;
    double p_xz = of_T * xz + of_adj * adj_xz;
    double p_yz = of_T * yz + of_adj * adj_yz;
    return (Mat3){{{of_I + of_T * xx + of_adj * adj_xx, p_xy, p_xz},
                   {p_xy, of_I + of_T * yy + of_adj * adj_yy, p_yz},
                   {p_xz, p_yz, of_I + of_T * zz + of_adj * adj_zz}}};
}

#endif

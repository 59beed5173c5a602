/* SPDX-License-Identifier: Apache-2.0 */
/* The rules that a header states of a parameter, as predicates. */
#ifndef FLIGHT_EXEC_BOUNDS_H
#define FLIGHT_EXEC_BOUNDS_H

#include <stdint.h>

/** How a number is bounded. */
enum {
    FLEDGE_HAS_LO = 1 << 0,
    FLEDGE_HAS_HI = 1 << 1,
    FLEDGE_LO_OPEN = 1 << 2, ///< lo itself is not allowed
    FLEDGE_HI_OPEN = 1 << 3  ///< hi itself is not allowed
};

/** Whether x is 0 or of a size from 1e-100 to 1e100. Then products of three such numbers, squares and inverses are
 *  finite, and no length of a vector is 0 but that of zero. No quantity in SI is beyond. */
static inline int exec_computable(double x)
{
    const double size = x < 0.0 ? -x : x;
    return size == 0.0 || (size >= 1e-100 && size <= 1e100);
}

/** Whether x keeps the bounds. NaN keeps none. */
static inline int exec_within(uint32_t bounds, double lo, double hi, double x)
{
    if ((bounds & FLEDGE_HAS_LO) != 0u && !((bounds & FLEDGE_LO_OPEN) != 0u ? x > lo : x >= lo)) {
        return 0;
    }
    return (bounds & FLEDGE_HAS_HI) == 0u || ((bounds & FLEDGE_HI_OPEN) != 0u ? x < hi : x <= hi);
}

/** Whether m + shift has only positive eigenvalues: Sylvester's criterion. */
static inline int exec_positive_definite(double (*m)[3], double shift)
{
    const double a = m[0][0] + shift, b = m[1][1] + shift, c = m[2][2] + shift;
    const double minor = a * b - m[0][1] * m[1][0];
    const double determinant = a * (b * c - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * c - m[1][2] * m[2][0]) +
                               m[0][2] * (m[1][0] * m[2][1] - b * m[2][0]);
    return a > 0.0 && minor > 0.0 && determinant > 0.0;
}

typedef enum ExecInertia {
    EXEC_INERTIA_GOOD,
    EXEC_INERTIA_ASYMMETRIC,
    EXEC_INERTIA_INDEFINITE, ///< not positive definite
    EXEC_INERTIA_NO_BODY     ///< a principal moment exceeds the sum of the others
} ExecInertia;

/** Whether a matrix can be the inertia of a body. */
static inline ExecInertia exec_inertia(double (*m)[3])
{
    const double trace = m[0][0] + m[1][1] + m[2][2];
    double rest[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double difference = m[i][j] - m[j][i], limit = 1e-9 * (trace < 0.0 ? -trace : trace);
            if (difference > limit) { /* if m[j][i] is the larger one, the pair (j, i) shows it */
                return EXEC_INERTIA_ASYMMETRIC;
            }
            rest[i][j] = (i == j ? 0.5 * trace : 0.0) - m[i][j];
        }
    }
    /* The tolerances allow for rounding: the zero moment of a rod that is not along an axis becomes
     * about 1e-16 of its trace. No principal moment exceeds the sum of the other two if and only if trace/2 - m
     * has no negative eigenvalue; that of a flat body is zero. */
    if (!exec_positive_definite(m, -1e-12 * trace)) {
        return EXEC_INERTIA_INDEFINITE;
    }
    return exec_positive_definite(rest, 1e-9 * trace) ? EXEC_INERTIA_GOOD : EXEC_INERTIA_NO_BODY;
}

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The elementary functions that flight and world code use instead of the C library's, so that a
 * result has the same bits on every machine and compiler.
 *
 * Every function is correct over the whole range of double, to within 1 ulp of the exact value
 * (the largest errors found stand in README.md). Angles are in radians. An invalid argument gives
 * the one quiet NaN of the macro NAN; special cases are those of C99 Annex F. None sets errno, and
 * the floating-point exception flags mean nothing afterwards. Rounding is to nearest. */
#ifndef FLIGHT_MATH_ELEMENTARY_H
#define FLIGHT_MATH_ELEMENTARY_H

#include <math.h>

#include "flight/math/strict.h"

#ifdef __cplusplus
extern "C" {
#endif

double fm_sin(double x);
double fm_cos(double x);
double fm_tan(double x);

/** *s = fm_sin(x) and *c = fm_cos(x), to the bit, for little more than the price of one. */
void fm_sincos(double x, double *s, double *c);

double fm_asin(double x); /**< in [-pi/2, pi/2]; NaN for |x| > 1 */
double fm_acos(double x); /**< in [0, pi]; NaN for |x| > 1 */
double fm_atan(double x); /**< in [-pi/2, pi/2] */

/** The angle of the point (x, y) from the x axis, in [-pi, pi]; signed zeros choose the side of the
 *  cut, and fm_atan2(0, 0) is 0. */
double fm_atan2(double y, double x);

double fm_exp(double x);
double fm_log(double x); /**< natural; -infinity for 0, NaN for x < 0 */

/** x to the power of y, exact wherever the power is a double; NaN for finite x < 0 unless y is an integer, and
 *  fm_pow(x, 0) and fm_pow(1, y) are 1, also of NaN. */
double fm_pow(double x, double y);

/** The machine's square root, which IEEE 754 rounds correctly. */
static inline double fm_sqrt(double x)
{
    return sqrt(x);
}

static inline double fm_abs(double x)
{
    return fabs(x);
}

#ifdef __cplusplus
}
#endif

#endif

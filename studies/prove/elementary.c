/* SPDX-License-Identifier: Apache-2.0 */
/* What modules get from the elementary functions: all that flight/math/elementary.h says of a result, which the tests
 * beside it hold against MPFR. That the functions themselves have no run-time errors, flight/math/elementary_proof.c
 * shows. A bound is exceeded by an ulp. */
#include "flight/math/elementary.h"

static const double ONE = 0x1.0000000000001p+0, PI = 0x1.921fb54442d19p+1, HALF_PI = 0x1.921fb54442d19p+0;

static double within(int valid, double low, double high)
{
    return valid ? any_number(low, high) : NAN;
}

double fm_sin(double x)
{
    return within(isfinite(x), -ONE, ONE);
}

double fm_cos(double x)
{
    return within(isfinite(x), -ONE, ONE);
}

void fm_sincos(double x, double *s, double *c)
{
    *s = fm_sin(x);
    *c = fm_cos(x);
}

double fm_tan(double x)
{
    return within(isfinite(x), -DBL_MAX, DBL_MAX);
}

double fm_asin(double x)
{
    return within(x >= -1.0 && x <= 1.0, -HALF_PI, HALF_PI);
}

double fm_acos(double x)
{
    return within(x >= -1.0 && x <= 1.0, 0.0, PI);
}

double fm_atan(double x)
{
    return within(x == x, -HALF_PI, HALF_PI);
}

double fm_atan2(double y, double x)
{
    return within(y == y && x == x, -PI, PI);
}

double fm_exp(double x)
{
    return x > 709.0 && any ? INFINITY : within(x == x, 0.0, DBL_MAX);
}

double fm_log(double x)
{
    return x == 0.0 ? -INFINITY : x > DBL_MAX ? x : within(x > 0.0, -746.0, 710.0);
}

double fm_pow(double x, double y)
{
    if (x >= 0.0 && y == y) {
        return any ? INFINITY : any_number(0.0, DBL_MAX);
    }
    return any ? NAN : any ? INFINITY : any ? -INFINITY : any_number(-DBL_MAX, DBL_MAX);
}

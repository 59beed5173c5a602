/* SPDX-License-Identifier: Apache-2.0 */
/* Arc tangent, arc sine and arc cosine. */
#include "flight/math/elementary.h"
#include "flight/math/ieee.h"

static const FmSum PI_OVER_2 = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};
static const double PI = 0x1.921fb54442d18p+1;

/* ---- arc tangent --------------------------------------------------------------------------------
 * A point (x, y) of the upper half plane is turned back by k pi/4 into the sector from -pi/8 to
 * pi/8 about the x axis. But for a factor sqrt 2, which cancels, that takes only sums:
 *
 *     n = c y - s x,   d = c x + s y,   angle = k pi/4 + atan(n/d),   atan u = u + u^3 A(u^2).
 *
 * Only n, d and k pi/4 decide the accuracy, and all three are unevaluated sums. */

typedef struct Sector {
    double c, s;
    FmSum middle; /* k pi/4 */
} Sector;

static const Sector SECTORS[5] = {
    {1.0, 0.0, {0.0, 0.0}},
    {1.0, 1.0, {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}},
    {0.0, 1.0, {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54}},
    {-1.0, 1.0, {0x1.2d97c7f3321d2p+1, 0x1.a79394c9e8a0ap-54}},
    {-1.0, 0.0, {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53}},
};

/* u^3 A(u^2), for |u| <= tan(pi/8). */
static inline double arctangent_minus(double u)
{
    const double z = u * u;
    const double z2 = z * z;
    const double z4 = z2 * z2;
    const double A0 =
        (-0x1.555555555553dp-2 + z * 0x1.9999999995864p-3) + z2 * (-0x1.24924922ad1d4p-3 + z * 0x1.c71c70e5ee502p-4);
    const double A4 =
        (-0x1.745cf8d831871p-4 + z * 0x1.3b1118cc07c36p-4) + z2 * (-0x1.10ebb49a0529ep-4 + z * 0x1.df0f1525e8242p-5);
    const double A8 = (-0x1.9cd1c96f8c79ap-5 + z * 0x1.37d33e2fbf936p-5) + z2 * -0x1.256525cc3bb0fp-6;
    return u * z * (A0 + z4 * (A4 + z4 * A8));
}

/* The angle of (x, y) for y > 0, whose exponents are moderate. */
static inline double angle(double y, double x)
{
    const double TAN_PI_8 = 0x1.a827999fcef32p-2;

    /* Count the limits passed, without branches: which way a point lies is hard to predict. */
    const double limit_x = TAN_PI_8 * x, limit_y = TAN_PI_8 * y;
    const int k = (y > limit_x) + (limit_y > x) + (-x > limit_y) + (-limit_x > y);
    const Sector sector = SECTORS[k];

    const FmSum n = fm_sum(sector.c * y, -(sector.s * x));
    const FmSum d = fm_sum(sector.c * x, sector.s * y);
    const FmSum u = fm_quotient(n, d);
    const double correction = u.lo + arctangent_minus(u.hi + u.lo);

    const FmSum result = fm_sum_ordered(sector.middle.hi, u.hi);
    return result.hi + (result.lo + (sector.middle.lo + correction));
}

static inline int is_moderate(double magnitude)
{
    return 0x1p-500 < magnitude && magnitude < 0x1p500;
}

/* The same for any x and y >= 0 that are not NaN. */
static double angle_of_extremes(double y, double x)
{
    const double size = fabs(x);
    const int left = (fm_sign(x) != 0);
    if (y == 0.0 && size == 0.0) {
        return left ? PI : 0.0;
    }
    if (y > DBL_MAX && size > DBL_MAX) {
        return SECTORS[left ? 3 : 1].middle.hi;
    }
    /* Scaling is exact here, except that it may flush what is negligible beside the other. */
    const double scale = (y > size ? y : size) > 1.0 ? 0x1p-600 : 0x1p600;
    if (is_moderate(y * scale) && is_moderate(size * scale)) {
        return angle(y * scale, x * scale);
    }
    if (y > size) {
        return PI_OVER_2.hi;
    }
    return left ? PI : y / x;
}

double fm_atan2(double y, double x)
{
    const double height = fabs(y), size = fabs(x);
    double result;
    if (is_moderate(height) && is_moderate(size)) {
        result = angle(height, x);
    } else if (height <= INFINITY && size <= INFINITY) {
        result = angle_of_extremes(height, x);
    } else {
        return NAN;
    }
    return fm_flip(result, fm_sign(y));
}

double fm_atan(double x)
{
    const double size = fabs(x);
    double result;
    if (is_moderate(size)) {
        result = angle(size, 1.0);
    } else if (size < 1.0) {
        result = size;
    } else if (size <= INFINITY) {
        result = PI_OVER_2.hi;
    } else {
        return NAN;
    }
    return fm_flip(result, fm_sign(x));
}

/* ---- arc sine and cosine ------------------------------------------------------------------------
 * asin x = x + x^3 B(x^2) for |x| <= 1/2; above, with z = (1 - |x|)/2, which is exact, and
 * s = sqrt z,
 *
 *     acos |x| = 2 asin s = 2 (s + s z B(z)). */

/* B(z), for z <= 1/4. */
static inline double arcsine_factor(double z)
{
    const double z2 = z * z;
    const double z4 = z2 * z2;
    const double B0 =
        (0x1.5555555555577p-3 + z * 0x1.333333332e132p-4) + z2 * (0x1.6db6db7212577p-5 + z * 0x1.f1c71a94f9a68p-6);
    const double B4 =
        (0x1.6e8bdedf826bfp-6 + z * 0x1.1c49f069a155cp-6) + z2 * (0x1.ca1f8c50bdc3ap-7 + z * 0x1.7585922f071bdp-7);
    const double B8 =
        (0x1.613c6042a4311p-7 + z * 0x1.e5f7f219cbcd9p-9) + z2 * (0x1.639bc38fcf348p-6 + z * -0x1.57fc9556e7786p-6);
    return B0 + z4 * (B4 + z4 * (B8 + z4 * 0x1.0b4679c6294f9p-5));
}

/* acos x for 1/2 <= x < 1: the leading part is exact in 27 bits. */
static inline FmSum arccosine_near_one(double x)
{
    const double z = 0.5 * (1.0 - x);
    const double s = sqrt(z);
    const double s1 = fm_head(s);
    const double s2 = (z - s1 * s1) / (s + s1);
    const FmSum result = {2.0 * s1, 2.0 * (s2 + s * z * arcsine_factor(z))};
    return result;
}

double fm_asin(double x)
{
    const double size = fabs(x);
    double result;
    if (size < 0.5) {
        result = size + size * (size * size) * arcsine_factor(size * size);
    } else if (size < 1.0) {
        const FmSum a = arccosine_near_one(size);
        const FmSum difference = fm_sum_ordered(PI_OVER_2.hi, -a.hi);
        result = difference.hi + (difference.lo + (PI_OVER_2.lo - a.lo));
    } else if (size == 1.0) {
        result = PI_OVER_2.hi;
    } else {
        return NAN;
    }
    return fm_flip(result, fm_sign(x));
}

typedef struct Supplement {
    FmSum start;
    double sign;
} Supplement;

double fm_acos(double x)
{
    const double size = fabs(x);
    if (size < 0.5) {
        const FmSum difference = fm_sum_ordered(PI_OVER_2.hi, -x);
        return difference.hi + (difference.lo + (PI_OVER_2.lo - x * (x * x) * arcsine_factor(x * x)));
    }
    if (size < 1.0) {
        /* Of a negative x, pi - acos |x|; again without a branch. */
        static const Supplement SUPPLEMENTS[2] = {
            {{0.0, 0.0}, 1.0},
            {{0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53}, -1.0},
        };
        const Supplement from = SUPPLEMENTS[x < 0.0];
        const FmSum a = arccosine_near_one(size);
        const FmSum result = fm_sum_ordered(from.start.hi, from.sign * a.hi);
        return result.hi + (result.lo + (from.start.lo + from.sign * a.lo));
    }
    if (size == 1.0) {
        return x > 0.0 ? 0.0 : PI;
    }
    return NAN;
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Sine, cosine and tangent.
 *
 * The argument is reduced to a rest |r| <= pi/4, itself a sum r.hi + r.lo (reduction.h). With
 * z = r.hi^2, minimax polynomials S and C (tools/coefficients.py) give
 *
 *     sin r = r.hi + [r.hi z S(z) + r.lo (1 - z/2)]
 *     cos r = h    + [z^2 C(z) + ((1 - h) - z/2) - r.hi r.lo],   h = 1 - z/2 rounded,
 *
 * in which the bracket is small, so that only the last addition rounds visibly. Both are computed
 * always: choosing one by the quadrant would cost more in mispredicted branches. */
#include "flight/math/elementary.h"
#include "flight/math/reduction.h"

static inline FmSum sine(FmSum r)
{
    const double z = r.hi * r.hi;
    const double z2 = z * z;
    const double S = (-0x1.5555555555548p-3 + z * 0x1.111111110f731p-7)
        + z2 * ((-0x1.a01a019be95f9p-13 + z * 0x1.71de35557bfbep-19)
                + z2 * (-0x1.ae5e4bd9ce657p-26 + z * 0x1.5d8b75dea5524p-33));
    const FmSum s = {r.hi, r.hi * z * S + r.lo * (1.0 - 0.5 * z)};
    return s;
}

static inline FmSum cosine(FmSum r)
{
    const double z = r.hi * r.hi;
    const double z2 = z * z;
    const double C = (0x1.555555555554bp-5 + z * -0x1.6c16c16c15014p-10)
        + z2 * ((0x1.a01a019c8efa9p-16 + z * -0x1.27e4f7f168e5bp-22)
                + z2 * (0x1.1ee9dbae72b11p-29 + z * -0x1.8fa671892b7e8p-37));
    const double h = 1.0 - 0.5 * z;
    const FmSum c = {h, z2 * C + (((1.0 - h) - 0.5 * z) - r.hi * r.lo)};
    return c;
}

/* Exchange a and b if the lowest bit of `odd` is set. */
static inline void exchange_if(uint32_t odd, double *a, double *b)
{
    const uint64_t difference = (fm_bits(*a) ^ fm_bits(*b)) & (0u - (uint64_t)(odd & 1));
    *a = fm_flip(*a, difference);
    *b = fm_flip(*b, difference);
}

static inline int is_finite(double x)
{
    return fabs(x) <= DBL_MAX;
}

/* The second bit of a quadrant, as a sign bit: set in the third and the fourth quadrant. */
static inline uint64_t half_turn_sign(uint32_t quadrant)
{
    return (uint64_t)(quadrant & 2) << 62;
}

void fm_sincos(double x, double *s, double *c)
{
    if (!is_finite(x)) {
        *s = *c = NAN;
        return;
    }
    const FmAngle a = fm_reduce(fabs(x));
    const FmSum sin_r = sine(a.rest), cos_r = cosine(a.rest);
    double sin_x = sin_r.hi + sin_r.lo, cos_x = cos_r.hi + cos_r.lo;
    exchange_if(a.quadrant, &sin_x, &cos_x);
    *s = fm_flip(sin_x, fm_sign(x) ^ half_turn_sign(a.quadrant));
    *c = fm_flip(cos_x, half_turn_sign(a.quadrant + 1));
}

double fm_sin(double x)
{
    double s, c;
    fm_sincos(x, &s, &c);
    return s;
}

double fm_cos(double x)
{
    double s, c;
    fm_sincos(x, &s, &c);
    return c;
}

/* tan r = sin r / cos r, and -cos r / sin r in the odd quadrants. */
double fm_tan(double x)
{
    if (!is_finite(x)) {
        return NAN;
    }
    const double magnitude = fabs(x);
    if (magnitude < 0x1p-27) {
        return x;  /* x^3/3 is below 0.1 ulp; a quotient of subnormals would lose bits */
    }
    const FmAngle a = fm_reduce(magnitude);
    FmSum n = sine(a.rest), d = cosine(a.rest);
    n = fm_sum(n.hi, n.lo);
    d = fm_sum(d.hi, d.lo);
    exchange_if(a.quadrant, &n.hi, &d.hi);
    exchange_if(a.quadrant, &n.lo, &d.lo);
    const FmSum t = fm_quotient(n, d);
    return fm_flip(t.hi + t.lo, fm_sign(x) ^ (uint64_t)a.quadrant << 63);
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Sine, cosine and tangent.
 *
 * The argument is reduced to a rest |r| <= pi/4, itself a sum r.hi + r.lo (reduction.h). With
 * z = r.hi^2, minimax polynomials S and C (tools/coefficients.py) give
 *
 *     sin r = r.hi + [r.hi z S(z) + r.lo (1 - z/2)]
 *     cos r = h    + [z^2 C(z) + ((1 - h) - z/2) - r.hi r.lo],   h = 1 - z/2 rounded,
 *
 * in which the bracket is small, so that little but the last addition rounds visibly. Both are
 * computed always: choosing one by the quadrant would cost more in mispredicted branches. */
#include "flight/math/elementary.h"
#include "flight/math/reduction.h"

typedef struct Terms {
    double leading, polynomial, tail;
} Terms;

static inline Terms sine(FmSum r)
{
    const double z = r.hi * r.hi;
    const double z2 = z * z;
    const double S = (-0x1.5555555555548p-3 + z * 0x1.111111110f731p-7) +
                     z2 * ((-0x1.a01a019be95f9p-13 + z * 0x1.71de35557bfbep-19) +
                           z2 * (-0x1.ae5e4bd9ce657p-26 + z * 0x1.5d8b75dea5524p-33));
    const Terms s = {r.hi, r.hi * z * S, r.lo * (1.0 - 0.5 * z)};
    return s;
}

static inline Terms cosine(FmSum r)
{
    const double z = r.hi * r.hi;
    const double z2 = z * z;
    const double C = (0x1.555555555554bp-5 + z * -0x1.6c16c16c15014p-10) +
                     z2 * ((0x1.a01a019c8efa9p-16 + z * -0x1.27e4f7f168e5bp-22) +
                           z2 * (0x1.1ee9dbae72b11p-29 + z * -0x1.8fa671892b7e8p-37));
    const double h = 1.0 - 0.5 * z;
    const Terms c = {h, z2 * C, ((1.0 - h) - 0.5 * z) - r.hi * r.lo};
    return c;
}

/* The second bit of a quadrant, as a sign bit: set in the third and the fourth quadrant. */
static inline uint64_t half_turn_sign(uint32_t quadrant)
{
    return (uint64_t)(quadrant & 2) << 62;
}

typedef struct SineCosine {
    double s, c;
} SineCosine;

static inline SineCosine sine_cosine(double x)
{
    if (!isfinite(x)) {
        const SineCosine none = {NAN, NAN};
        return none;
    }
    const FmAngle a = fm_reduce(fabs(x));
    const Terms s = sine(a.rest), c = cosine(a.rest);
    const double of_rest[2] = {s.leading + (s.polynomial + s.tail), c.leading + (c.polynomial + c.tail)};
    const uint32_t odd = a.quadrant & 1;
    const SineCosine of_x = {
        fm_flip(of_rest[odd], fm_sign(x) ^ half_turn_sign(a.quadrant)),
        fm_flip(of_rest[1 - odd], half_turn_sign(a.quadrant + 1)),
    };
    return of_x;
}

void fm_sincos(double x, double *s, double *c)
{
    const SineCosine both = sine_cosine(x);
    *s = both.s;
    *c = both.c;
}

double fm_sin(double x)
{
    return sine_cosine(x).s;
}

double fm_cos(double x)
{
    return sine_cosine(x).c;
}

/* tan r = sin r / cos r, and -cos r / sin r in the odd quadrants. For the quotient to be within
 * 1 ulp, both are corrected for the rounding of z. */
double fm_tan(double x)
{
    if (!isfinite(x)) {
        return NAN;
    }
    const double magnitude = fabs(x);
    if (magnitude < 0x1p-27) {
        return x; /* x^3/3 is below 0.1 ulp; a quotient of subnormals would lose bits */
    }
    const FmAngle a = fm_reduce(magnitude);
    const double rest_of_z = fm_product(a.rest.hi, a.rest.hi).lo;
    const Terms s = sine(a.rest), c = cosine(a.rest);
    const double s_tail = s.tail - a.rest.hi * rest_of_z * 0x1.5555555555555p-3;
    const double c_tail = c.tail - 0.5 * rest_of_z;
    const FmSum of_rest[2] = {
        fm_sum_ordered(s.leading, s.polynomial + s_tail),
        fm_sum_ordered(c.leading, c.polynomial + c_tail),
    };
    const uint32_t odd = a.quadrant & 1;
    const FmSum t = fm_quotient(of_rest[odd], of_rest[1 - odd]);
    return fm_flip(t.hi + t.lo, fm_sign(x) ^ (uint64_t)a.quadrant << 63);
}

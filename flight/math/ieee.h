/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/math: the bits of a double, and arithmetic on unevaluated sums hi + lo.
 *
 * An integer and a double of 64 bits share their byte order on all our machines, so memcpy makes
 * the sign bit 63 everywhere. Sums and products are those of Knuth, and of Dekker, "A
 * floating-point technique for extending the available precision", 1971, with a double halved by
 * masking. */
#ifndef FLIGHT_MATH_IEEE_H
#define FLIGHT_MATH_IEEE_H

#include <stdint.h>
#include <string.h>

#include "flight/math/strict.h"

#define FM_SIGN_BIT 0x8000000000000000u
#define FM_FRACTION 0x000fffffffffffffu
#define FM_HIDDEN_BIT 0x0010000000000000u

/* Added to |t| < 2^51, it leaves t rounded to an integer in the lowest bits. */
#define FM_ROUND_TO_INTEGER 0x1.8p52

typedef struct FmSum {
    double hi, lo;
} FmSum;

static inline uint64_t fm_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double fm_from_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* The biased exponent of a positive number: 1022 of 1/2, 2046 of the largest. */
static inline int32_t fm_exponent(double x)
{
    return (int32_t)(fm_bits(x) >> 52);
}

static inline uint64_t fm_sign(double x)
{
    return fm_bits(x) & FM_SIGN_BIT;
}

/* x, or -x when the sign bit is set in `sign`. */
static inline double fm_flip(double x, uint64_t sign)
{
    return fm_from_bits(fm_bits(x) ^ sign);
}

/* 2^e for a normal result. */
static inline double fm_power_of_two(int32_t e)
{
    return fm_from_bits((uint64_t)(uint32_t)(e + 1023) << 52);
}

/* The leading 26 bits of x: the product of two such is exact, and x - head(x) has 27 bits. */
static inline double fm_head(double x)
{
    return fm_from_bits(fm_bits(x) & ~(uint64_t)0x7ffffff);
}

/* a + b exactly. */
static inline FmSum fm_sum(double a, double b)
{
    const double hi = a + b;
    const double b_in_hi = hi - a;
    const FmSum sum = {hi, (a - (hi - b_in_hi)) + (b - b_in_hi)};
    return sum;
}

/* The same, if |a| >= |b| or a == 0. */
static inline FmSum fm_sum_ordered(double a, double b)
{
    const double hi = a + b;
    const FmSum sum = {hi, (a - hi) + b};
    return sum;
}

/* a * b to about 2^-105. */
static inline FmSum fm_product(double a, double b)
{
    const double a1 = fm_head(a), a2 = a - a1;
    const double b1 = fm_head(b), b2 = b - b1;
    const double hi = a * b;
    const FmSum product = {hi, ((a1 * b1 - hi) + a1 * b2 + a2 * b1) + a2 * b2};
    return product;
}

/* n / d to about 2^-76: a quotient q of 26 bits, for which n - q d is nearly free of rounding, and
 * the rest. The caller keeps the exponents away from overflow and underflow. */
static inline FmSum fm_quotient(FmSum n, FmSum d)
{
    const double inverse = 1.0 / d.hi;
    const double q = fm_head(n.hi * inverse);
    const double d1 = fm_head(d.hi), d2 = d.hi - d1;
    const double rest = ((n.hi - q * d1) - q * d2) + (n.lo - q * d.lo);
    const FmSum quotient = {q, rest * inverse};
    return quotient;
}

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The rest of a large angle modulo pi/2, after Payne and Hanek, "Radian reduction for trigonometric
 * functions", 1983, in integers.
 *
 * x = M 2^e with a 53-bit integer M. In the product of x with the bits of 2/pi,
 *
 *     x (2/pi) = sum_j M 2^(e-j) b_j,
 *
 * the terms with e - j >= 2 are multiples of 4, whole turns. So a window of 192 bits that begins at
 * j = e - 1 is enough, and the product with M is needed only modulo 2^192: two bits of quadrant and
 * 190 of fraction, wrong by less than 2^-137. No double comes closer to a multiple of pi/2 than
 * 2^-62, which leaves 75 bits. */
#include "flight/math/reduction.h"

enum { WINDOW = 6, LEADING_ZEROS = 64 };

/* 2/pi after its binary point, most significant word first, behind 64 zeros for small x. */
static const uint32_t TWO_OVER_PI[39] = {
    0x00000000u, 0x00000000u, 0xa2f9836eu, 0x4e441529u, 0xfc2757d1u, 0xf534ddc0u, 0xdb629599u, 0x3c439041u,
    0xfe5163abu, 0xdebbc561u, 0xb7246e3au, 0x424dd2e0u, 0x06492eeau, 0x09d1921cu, 0xfe1deb1cu, 0xb129a73eu,
    0xe88235f5u, 0x2ebb4484u, 0xe99c7026u, 0xb45f7e41u, 0x3991d639u, 0x835339f4u, 0x9c845f8bu, 0xbdf9283bu,
    0x1ff897ffu, 0xde05980fu, 0xef2f118bu, 0x5a0a6d1fu, 0x6d367ecfu, 0x27cb09b7u, 0x4f463f66u, 0x9e5fea2du,
    0x7527bac7u, 0xebe5f17bu, 0x3d0739f7u, 0x8a5292eau, 0x6bfb5fb1u, 0x1f8d5d08u, 0x56033046u,
};

static void window_at(uint32_t window[WINDOW], uint32_t bit)
{
    const uint32_t word = bit / 32, shift = bit % 32;
    for (uint32_t i = 0; i < WINDOW; ++i) {
        const uint64_t two = (uint64_t)TWO_OVER_PI[word + i] << 32 | TWO_OVER_PI[word + i + 1];
        window[i] = (uint32_t)(two >> (32 - shift));
    }
}

/* product = a m modulo 2^192. */
static void multiply(uint32_t product[WINDOW], const uint32_t a[WINDOW], uint64_t m)
{
    const uint32_t m_low = (uint32_t)m, m_high = (uint32_t)(m >> 32);
    uint32_t carry = 0;
    for (int i = WINDOW - 1; i >= 0; --i) {
        const uint64_t t = (uint64_t)a[i] * m_low + carry;
        product[i] = (uint32_t)t;
        carry = (uint32_t)(t >> 32);
    }
    carry = 0;
    for (int i = WINDOW - 1; i >= 1; --i) {
        const uint64_t t = (uint64_t)a[i] * m_high + product[i - 1] + carry;
        product[i - 1] = (uint32_t)t;
        carry = (uint32_t)(t >> 32);
    }
}

FmAngle fm_reduce_far(double x)
{
    static const FmSum PI_OVER_2 = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};
    static const double UNIT[3] = {0x1p-32, 0x1p-64, 0x1p-96};

    const int32_t e = fm_exponent(x) - (1023 + 52);
    uint32_t window[WINDOW], f[WINDOW];
    window_at(window, (uint32_t)(LEADING_ZEROS + e - 2));
    multiply(f, window, (fm_bits(x) & FM_FRACTION) | FM_HIDDEN_BIT);

    /* Split quadrant and fraction; a fraction above one half belongs to the next quadrant. */
    uint32_t quadrant = f[0] >> 30;
    for (int i = 0; i < WINDOW - 1; ++i) {
        f[i] = f[i] << 2 | f[i + 1] >> 30;
    }
    const uint32_t above_half = f[0] >> 31;
    const uint32_t complement = 0u - above_half;
    quadrant += above_half;
    for (int i = 0; i < WINDOW; ++i) {
        f[i] ^= complement;
    }

    /* Four words from the first that is not zero hold at least 97 bits. */
    int top = 0;
    /* undecided: a guard; no double is so near to a multiple of pi/2 that both words are 0 */
    while (top < 2 && f[top] == 0) {
        ++top;
    }
    FmSum fraction = fm_sum_ordered((double)f[top], (double)f[top + 1] * 0x1p-32);
    fraction.lo += (double)f[top + 2] * 0x1p-64 + (double)f[top + 3] * 0x1p-96;

    FmSum rest = fm_product(fraction.hi, PI_OVER_2.hi);
    rest.lo += fraction.hi * PI_OVER_2.lo + fraction.lo * PI_OVER_2.hi;
    rest = fm_sum_ordered(rest.hi, rest.lo);

    const double unit = above_half ? -UNIT[top] : UNIT[top];
    const FmAngle angle = {{rest.hi * unit, rest.lo * unit}, quadrant};
    return angle;
}

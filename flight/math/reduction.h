/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/math: an angle as a multiple of a right angle and a rest. */
#ifndef FLIGHT_MATH_REDUCTION_H
#define FLIGHT_MATH_REDUCTION_H

#include <math.h>
#include <stdint.h>

#include "flight/math/ieee.h"

typedef struct FmAngle {
    FmSum rest;        /* |rest| <= pi/4 and a little */
    uint32_t quadrant; /* only the lowest two bits matter */
} FmAngle;

/* x = quadrant pi/2 + rest, modulo 2 pi, for finite x >= 1/2 however large. */
FmAngle fm_reduce_far(double x);

/* The same for any finite x >= 0. */
static inline FmAngle fm_reduce(double x)
{
    /* pi/2 in 33 + 33 + 53 bits: for n < 2^20, n PI1 and n PI2 are exact. */
    const double PI1 = 0x1.921fb544p+0, PI2 = 0x1.0b4611a6p-34, PI3 = 0x1.3198a2e037073p-69;
    const double TWO_OVER_PI = 0x1.45f306dc9c883p-1;

    if (x < 0x1p20) {
        const double shifted = x * TWO_OVER_PI + FM_ROUND_TO_INTEGER;
        const double n = shifted - FM_ROUND_TO_INTEGER;

        /* x - n PI1 cancels exactly, and what the next subtractions round off is kept. (Where
         * x - n PI1 is the smaller one, the difference is exact.) */
        const FmSum first = fm_sum_ordered(x - n * PI1, -(n * PI2));
        const FmAngle near = {fm_sum_ordered(first.hi, first.lo - n * PI3), (uint32_t)fm_bits(shifted)};

        /* PI3 leaves an error below n 2^-120: too much only next to a multiple of pi/2. */
        /* undecided: below 1/2 n is 0, for which the first holds; the second shows it to fledge prove */
        if (fabs(near.rest.hi) >= n * 0x1p-60 || x < 0.5) {
            return near;
        }
    }
    return fm_reduce_far(x);
}

#endif

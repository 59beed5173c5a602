/* SPDX-License-Identifier: Apache-2.0 */
/* What drivers of a proof draw from, for Frama-C alone; included before every source that is analysed. */
#ifndef FLEDGE_PROVE_H
#define FLEDGE_PROVE_H

#include <__fc_builtin.h>
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

/* By comparisons the analyser learns the bounds of x itself; NaN alone differs from itself. */
#undef isfinite
#define isfinite(x) ((x) == (x) && (x) >= -DBL_MAX && (x) <= DBL_MAX)

/* Tests of structs by value would test copies: as macros, they test the numbers themselves. */
#if __has_include("flight/math/vec.h")
#include "flight/math/vec.h"
#define vec_finite(a) (isfinite((a).v[0]) && isfinite((a).v[1]) && isfinite((a).v[2]))
#define mat_finite(a)                                                                                                  \
    (isfinite((a).m[0][0]) && isfinite((a).m[0][1]) && isfinite((a).m[0][2]) && isfinite((a).m[1][0]) &&               \
     isfinite((a).m[1][1]) && isfinite((a).m[1][2]) && isfinite((a).m[2][0]) && isfinite((a).m[2][1]) &&               \
     isfinite((a).m[2][2]))
#endif

/* Vectors whose length is bounded have finite numbers, which intervals do not see: flight/math/vec_proof.c shows it. */
#if __has_include("flight/msg/sensors.h")
#include "flight/msg/sensors.h"
#define gyro_speaks(gyro) ((gyro_speaks)(gyro) && vec_finite((gyro)->omega_BN_B))
#endif
#if __has_include("flight/msg/navigation.h")
#include "flight/msg/navigation.h"
#define direction_speaks(seen)                                                                                         \
    ((direction_speaks)(seen) && vec_finite((seen)->d_B) && vec_finite((seen)->d_N) && isfinite((seen)->std))
#endif

/** 0 or another number, another one at each reading. */
extern volatile int any;

/** [ns] No instant is later, 73 years after the start of the run. */
#define PROVE_TIME (INT64_C(1) << 61)

static inline void any_bits(void *p, size_t n)
{
    Frama_C_make_unknown((char *)p, n);
}

static inline int64_t any_integer(int64_t lo, int64_t hi)
{
    return (int64_t)Frama_C_long_long_interval(lo, hi);
}

static inline uint64_t any_unsigned(uint64_t lo, uint64_t hi)
{
    return (uint64_t)Frama_C_unsigned_long_long_interval(lo, hi);
}

static inline double any_number(double lo, double hi)
{
    return Frama_C_double_interval(lo, hi);
}

/* The exponent of a number, which the analyser does not see in its bits: of 0.5 it is 1022, of DBL_MAX 2046. */
static inline int32_t prove_exponent(double x)
{
    return (int32_t)(0.5 <= x && x <= DBL_MAX ? any_integer(1022, 2046) : any_integer(0, 4095));
}

#if __has_include("flight/math/ieee.h")
#include "flight/math/ieee.h"
#define fm_exponent(x) prove_exponent(x)
#endif

/** n numbers within bounds. */
static inline void any_numbers(double *x, size_t n, double lo, double hi)
{
    /*@ loop unroll n; */
    for (size_t i = 0u; i < n; i++) {
        x[i] = Frama_C_double_interval(lo, hi);
    }
}

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Refuses compilers and options under which floating-point arithmetic would not be IEEE 754 double
 * precision, one rounding per operation: the arithmetic that gives the same bits on every machine.
 * What a header cannot see stands in the build: -ffp-contract=off (gcc announces fused
 * multiply-adds by no macro) and -fno-math-errno. */
#ifndef FLIGHT_MATH_STRICT_H
#define FLIGHT_MATH_STRICT_H

#include <float.h>

#if defined(__FAST_MATH__)
#error "flight code needs IEEE arithmetic: do not compile with -ffast-math or -Ofast"
#endif

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "flight code handles infinities and NaN: do not compile with -ffinite-math-only"
#endif

#if !defined(FLT_EVAL_METHOD) || FLT_EVAL_METHOD != 0
#error "flight code needs doubles without excess precision (on 32-bit x86: -msse2 -mfpmath=sse)"
#endif

#if FLT_RADIX != 2 || DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024
#error "flight code needs IEEE 754 binary64 as double"
#endif

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The module math of scripts, and the power of floats: by flight/math, so that a script computes the same bits on every
 * target. */
#include <math.h>

#include <py/obj.h>
#include <py/objmodule.h>
#include <py/runtime.h>

#include "flight/math/elementary.h"

/* ---- powers */

/* high + low: a number with about twice the digits of a double. */
typedef struct Pair {
    double high, low;
} Pair;

static Pair sum(double a, double b) /* |a| >= |b| */
{
    const double high = a + b;
    return (Pair){high, b - (high - a)};
}

/* a * b exactly, by halves of their digits. */
static Pair product(double a, double b)
{
    const double split = 134217729.0; /* 2^27 + 1 */
    const double a_high = a * split - (a * split - a), a_low = a - a_high;
    const double b_high = b * split - (b * split - b), b_low = b - b_high;
    const double high = a * b;
    return (Pair){high, ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low};
}

static Pair times(Pair a, Pair b)
{
    const Pair p = product(a.high, b.high);
    return sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}

/* x^exponent, which is > 0, or what is inverse to it. */
static double whole_power(double x, unsigned exponent, int inverse)
{
    unsigned n = exponent;
    double plain = 1.0;
    Pair result = {1.0, 0.0}, base = {x, 0.0};
    for (double square = x;; square *= square) {
        if (n & 1u) {
            result = times(result, base);
            plain *= square;
        }
        n >>= 1;
        if (n == 0u) {
            break;
        }
        base = times(base, base);
    }
    /* Where halves of digits overflow or vanish, the plain product is what remains. */
    const int exact = fm_abs(plain) > 1e-280 && fm_abs(plain) < 1e280 && result.low - result.low == 0.0;
    if (!inverse) {
        return exact ? result.high + result.low : plain;
    }
    if (!exact && exponent > 1u && fm_abs(plain) == INFINITY) { /* its inverse may be a subnormal number */
        const double half = whole_power(x, exponent / 2u, 1);
        return half == 0.0 ? half : half * whole_power(x, exponent - exponent / 2u, 1);
    }
    const double q = 1.0 / (exact ? result.high : plain);
    if (!exact) {
        return q;
    }
    const Pair back = product(q, result.high);
    return q + ((1.0 - back.high) - back.low - q * result.low) / result.high;
}

double script_pow(double x, double y);

/* As C's pow(). A whole power and a square root are exact to the last digit; others have the digits that exp and log of
 * flight/math give. */
double script_pow(double x, double y)
{
    enum { MOST = 1 << 20 };
    const double size = fm_abs(y);
    if (y == 0.0 || x == 1.0) {
        return 1.0;
    }
    if (x != x || y != y) {
        return x + y;
    }
    if (size <= MOST && (double)(unsigned)size == size) {
        return whole_power(x, (unsigned)size, y < 0.0);
    }
    if (y == 0.5) {
        return fm_abs(x) == INFINITY ? INFINITY : fm_sqrt(x + 0.0);
    }
    if (x < 0.0) { /* a large whole number is even */
        return size >= 9007199254740992.0 || fmod(size, 2.0) == 0.0 ? script_pow(-x, y)
               : fmod(size, 2.0) == 1.0                             ? -script_pow(-x, y)
                                                                    : NAN;
    }
    if (x == 0.0) {
        return y > 0.0 ? 0.0 : INFINITY;
    }
    return fm_exp(y * fm_log(x));
}

/* ---- the module */

static NORETURN void outside(void)
{
    mp_raise_ValueError(MP_ERROR_TEXT("math domain error"));
}

/* What C answers with NaN or infinity raises, as in Python, if a number was given. */
static mp_obj_t checked(double result, int given)
{
    if (given && result - result != 0.0) {
        if (result == INFINITY) {
            mp_raise_msg(&mp_type_OverflowError, MP_ERROR_TEXT("math range error"));
        }
        outside();
    }
    return mp_obj_new_float(result);
}

static int is_finite(double x)
{
    return x - x == 0.0;
}

#define FUNCTION(name, result)                                                                                         \
    static mp_obj_t math_##name(mp_obj_t object)                                                                       \
    {                                                                                                                  \
        const double x = mp_obj_get_float(object);                                                                     \
        return result;                                                                                                 \
    }                                                                                                                  \
    static MP_DEFINE_CONST_FUN_OBJ_1(math_##name##_obj, math_##name)
#define FUNCTION_OF_TWO(name, result)                                                                                  \
    static mp_obj_t math_##name(mp_obj_t first, mp_obj_t second)                                                       \
    {                                                                                                                  \
        const double x = mp_obj_get_float(first), y = mp_obj_get_float(second);                                        \
        return result;                                                                                                 \
    }                                                                                                                  \
    static MP_DEFINE_CONST_FUN_OBJ_2(math_##name##_obj, math_##name)

FUNCTION(sqrt, checked(fm_sqrt(x), is_finite(x) || x < 0.0));
FUNCTION(sin, checked(fm_sin(x), x == x));
FUNCTION(cos, checked(fm_cos(x), x == x));
FUNCTION(tan, checked(fm_tan(x), x == x));
FUNCTION(asin, checked(fm_asin(x), x == x));
FUNCTION(acos, checked(fm_acos(x), x == x));
FUNCTION(atan, mp_obj_new_float(fm_atan(x)));
FUNCTION(exp, checked(fm_exp(x), is_finite(x)));
FUNCTION(log, checked(fm_log(x), is_finite(x) || x < 0.0));
FUNCTION(fabs, mp_obj_new_float(fm_abs(x)));
FUNCTION(floor, mp_obj_new_int_from_float(floor(x)));
FUNCTION(ceil, mp_obj_new_int_from_float(ceil(x)));
FUNCTION(trunc, mp_obj_new_int_from_float(trunc(x)));
FUNCTION(isnan, mp_obj_new_bool(x != x));
FUNCTION(isinf, mp_obj_new_bool(fm_abs(x) == INFINITY));
FUNCTION(isfinite, mp_obj_new_bool(is_finite(x)));
FUNCTION(radians, mp_obj_new_float(x * 0.017453292519943295));
FUNCTION(degrees, mp_obj_new_float(x * 57.29577951308232));
FUNCTION_OF_TWO(atan2, mp_obj_new_float(fm_atan2(x, y)));
FUNCTION_OF_TWO(copysign, mp_obj_new_float(copysign(x, y)));
FUNCTION_OF_TWO(fmod, checked(fmod(x, y), x == x && y == y));
FUNCTION_OF_TWO(pow, checked(script_pow(x, y), is_finite(x) && is_finite(y)));

#define ENTRY(name)                                                                                                    \
    {                                                                                                                  \
        MP_ROM_QSTR(MP_QSTR_##name), MP_ROM_PTR(&math_##name##_obj)                                                    \
    }
static const mp_rom_map_elem_t members[] = {
    {MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_math)},
    {MP_ROM_QSTR(MP_QSTR_pi), mp_const_float_pi},
    {MP_ROM_QSTR(MP_QSTR_e), mp_const_float_e},
    {MP_ROM_QSTR(MP_QSTR_tau), mp_const_float_tau},
    {MP_ROM_QSTR(MP_QSTR_inf), mp_const_float_inf},
    {MP_ROM_QSTR(MP_QSTR_nan), mp_const_float_nan},
    ENTRY(sqrt),
    ENTRY(sin),
    ENTRY(cos),
    ENTRY(tan),
    ENTRY(asin),
    ENTRY(acos),
    ENTRY(atan),
    ENTRY(atan2),
    ENTRY(exp),
    ENTRY(log),
    ENTRY(pow),
    ENTRY(fabs),
    ENTRY(floor),
    ENTRY(ceil),
    ENTRY(trunc),
    ENTRY(fmod),
    ENTRY(copysign),
    ENTRY(isnan),
    ENTRY(isinf),
    ENTRY(isfinite),
    ENTRY(radians),
    ENTRY(degrees),
};
static MP_DEFINE_CONST_DICT(members_dict, members);

const mp_obj_module_t script_math = {.base = {&mp_type_module}, .globals = (mp_obj_dict_t *)&members_dict};
MP_REGISTER_MODULE(MP_QSTR_math, script_math);

/* SPDX-License-Identifier: Apache-2.0 */
/* The module math of scripts, and the power of floats: by flight/math, so that a script computes the same bits on every
 * target, and on the desktop (python/fledge/mission/target_math.py). */
#include <math.h>

#include <py/obj.h>
#include <py/objmodule.h>
#include <py/runtime.h>

#include "flight/math/elementary.h"

/* ---- the module */

static int is_finite(double x)
{
    return x - x == 0.0;
}

static NORETURN void outside(void)
{
    mp_raise_ValueError(MP_ERROR_TEXT("math domain error"));
}

static NORETURN void beyond(void)
{
    mp_raise_msg(&mp_type_OverflowError, MP_ERROR_TEXT("math range error"));
}

/* What C answers with NaN or infinity raises, as in Python, if a number was given. */
static mp_obj_t checked(double result, int given)
{
    if (given && !is_finite(result)) {
        if (result == INFINITY) {
            beyond();
        }
        outside();
    }
    return mp_obj_new_float(result);
}

double script_pow(double x, double y)
{
    const double result = fm_pow(x, y);
    if (fm_abs(result) == INFINITY && is_finite(x) && is_finite(y)) {
        beyond();
    }
    return result;
}

static mp_obj_t pow_of(double x, double y)
{
    if (is_finite(x) && is_finite(y) && (x < 0.0 ? floor(y) != y : x == 0.0 && y < 0.0)) {
        outside();
    }
    return mp_obj_new_float(script_pow(x, y));
}

/* The natural logarithm, or that to a base. */
static mp_obj_t math_log(size_t n, const mp_obj_t *arguments)
{
    const double x = mp_obj_get_float(arguments[0]);
    const mp_obj_t natural = checked(fm_log(x), is_finite(x) || x < 0.0);
    return n == 1 ? natural : mp_binary_op(MP_BINARY_OP_TRUE_DIVIDE, natural, math_log(1, &arguments[1]));
}
static MP_DEFINE_CONST_FUN_OBJ_VAR_BETWEEN(math_log_obj, 1, 2, math_log);

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
FUNCTION_OF_TWO(pow, pow_of(x, y));

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

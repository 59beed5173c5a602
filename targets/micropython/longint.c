/* SPDX-License-Identifier: Apache-2.0 */
/* Integers that do not fit into an object, up to 64 bits. What is larger raises OverflowError. An object of these takes
 * memory, so they exist at the start alone. */
#include <py/binary.h>
#include <py/obj.h>
#include <py/objint.h>
#include <py/runtime.h>
#include <py/smallint.h>

#include "targets/micropython/arena.h"

bool script_times(mp_const_obj_t object, mp_int_t *n);
mp_int_t script_range_int(mp_const_obj_t object);

static NORETURN void overflow(void)
{
    mp_raise_msg(&mp_type_OverflowError, MP_ERROR_TEXT("integer beyond 64 bits"));
}

static long long value_of(mp_const_obj_t o)
{
    return mp_obj_is_small_int(o) ? MP_OBJ_SMALL_INT_VALUE(o) : ((const mp_obj_int_t *)MP_OBJ_TO_PTR(o))->val;
}

mp_obj_t mp_obj_new_int_from_ll(long long value)
{
    if (MP_SMALL_INT_FITS((mp_uint_t)value)) {
        return MP_OBJ_NEW_SMALL_INT(value);
    }
    mp_obj_int_t *o = mp_obj_malloc(mp_obj_int_t, &mp_type_int);
    o->val = value;
    return MP_OBJ_FROM_PTR(o);
}

mp_obj_t mp_obj_new_int_from_ull(unsigned long long value)
{
    if (value > INT64_MAX) {
        overflow();
    }
    return mp_obj_new_int_from_ll((long long)value);
}

mp_obj_t mp_obj_new_int(mp_int_t value)
{
    return mp_obj_new_int_from_ll(value);
}

mp_obj_t mp_obj_new_int_from_uint(mp_uint_t value)
{
    return mp_obj_new_int_from_ull(value);
}

mp_obj_t mp_obj_new_int_from_str_len(const char **text, size_t n, bool negative, unsigned base)
{
    const char *at = *text, *end = at + n;
    long long value = 0;
    for (; at < end; at++) {
        const unsigned char c = (unsigned char)*at;
        const int digit = c >= '0' && c <= '9'                     ? c - '0'
                          : (c | 0x20) >= 'a' && (c | 0x20) <= 'z' ? (c | 0x20) - 'a' + 10
                                                                   : 99;
        if (c == '_') {
            continue;
        }
        if (digit >= (int)base) {
            break;
        }
        if (__builtin_mul_overflow(value, (long long)base, &value) ||
            __builtin_add_overflow(value, (long long)(negative ? -digit : digit), &value)) {
            overflow();
        }
    }
    *text = at;
    return mp_obj_new_int_from_ll(value);
}

mp_int_t mp_obj_int_get_truncated(mp_const_obj_t o)
{
    return value_of(o);
}

mp_int_t mp_obj_int_get_checked(mp_const_obj_t o)
{
    return value_of(o);
}

mp_float_t mp_obj_int_as_float_impl(mp_obj_t o)
{
    return (mp_float_t)value_of(o);
}

int mp_obj_int_sign(mp_obj_t o)
{
    const long long value = value_of(o);
    return (value > 0) - (value < 0);
}

mp_obj_t mp_obj_int_from_bytes_impl(bool big_endian, size_t n, const byte *bytes)
{
    unsigned long long value = 0;
    for (size_t i = 0; i < n; i++) {
        if (value >> 55 != 0u) {
            overflow();
        }
        value = value << 8 | bytes[big_endian ? i : n - 1u - i];
    }
    return mp_obj_new_int_from_ll((long long)value);
}

bool mp_obj_int_to_bytes_impl(mp_obj_t o, bool big_endian, size_t n, byte *bytes)
{
    long long value = value_of(o);
    for (size_t i = 0; i < n; i++) {
        bytes[big_endian ? n - 1u - i : i] = (byte)value;
        value = i < 7u ? value >> 8 : value >> 7 >> 1;
    }
    return value == 0 || value == -1;
}

mp_obj_t mp_obj_int_unary_op(mp_unary_op_t op, mp_obj_t o)
{
    const long long value = value_of(o);
    switch (op) {
    case MP_UNARY_OP_BOOL: return mp_obj_new_bool(value != 0);
    case MP_UNARY_OP_HASH: return MP_OBJ_NEW_SMALL_INT(value);
    case MP_UNARY_OP_POSITIVE:
    case MP_UNARY_OP_INT_MAYBE: return o;
    case MP_UNARY_OP_INVERT: return mp_obj_new_int_from_ll(~value);
    case MP_UNARY_OP_ABS:
        if (value >= 0) {
            return o;
        } /* fall through */
    case MP_UNARY_OP_NEGATIVE:
        if (value == INT64_MIN) {
            overflow();
        }
        return mp_obj_new_int_from_ll(-value);
    default: return MP_OBJ_NULL;
    }
}

static long long power(long long base, long long exponent)
{
    long long result = 1;
    for (;;) {
        if ((exponent & 1) && __builtin_mul_overflow(result, base, &result)) {
            overflow();
        }
        exponent >>= 1;
        if (exponent == 0) {
            return result;
        }
        if (__builtin_mul_overflow(base, base, &base)) {
            overflow();
        }
    }
}

static long long shifted_left(long long a, long long n)
{
    if (n < 0) {
        mp_raise_ValueError(MP_ERROR_TEXT("negative shift count"));
    }
    if (a != 0 && (n > 62 || a > INT64_MAX >> n || a < INT64_MIN >> n)) {
        overflow();
    }
    return a == 0 ? 0 : (long long)((unsigned long long)a << n);
}

static long long shifted_right(long long a, long long n)
{
    if (n < 0) {
        mp_raise_ValueError(MP_ERROR_TEXT("negative shift count"));
    }
    return a >> (n < 63 ? n : 63);
}

/* As Python divides: the remainder has the sign of the divisor. */
static long long divided(long long a, long long b, long long *rest)
{
    if (b == 0) {
        mp_raise_msg(&mp_type_ZeroDivisionError, MP_ERROR_TEXT("divide by zero"));
    }
    if (b == -1) { /* the least integer has no counterpart */
        *rest = 0;
        if (a == INT64_MIN) {
            overflow();
        }
        return -a;
    }
    const long long q = a / b, r = a % b;
    const int turn = r != 0 && (r < 0) != (b < 0);
    *rest = turn ? r + b : r;
    return turn ? q - 1 : q;
}

static uint64_t size_of(long long value)
{
    return value < 0 ? 0u - (uint64_t)value : (uint64_t)value;
}

/* a / b, rounded once; b is not 0. */
static double quotient(long long a, long long b)
{
    const uint64_t n = size_of(a), d = size_of(b), exact = (uint64_t)1 << 53;
    if (n <= exact && d <= exact) {
        return (double)a / (double)b;
    }
    uint64_t digits = n / d, rest = n % d;
    double scale = 1.0;
    for (; n != 0u && digits >> 55 == 0u; scale *= 0.5) {
        rest <<= 1;
        digits = digits << 1 | (uint64_t)(rest >= d);
        rest -= rest >= d ? d : 0u;
    }
    const double result = (double)(digits | (uint64_t)(rest != 0u)) * scale;
    return (a < 0) != (b < 0) ? -result : result;
}

mp_obj_t mp_obj_int_binary_op(mp_binary_op_t op, mp_obj_t left, mp_obj_t right)
{
    if (mp_obj_is_float(right)) {
        return mp_obj_float_binary_op(op, (mp_float_t)value_of(left), right);
    }
    if (!mp_obj_is_int(right)) {
        return mp_obj_int_binary_op_extra_cases(op, left, right);
    }
    const long long a = value_of(left), b = value_of(right);
    long long result = 0, rest = 0;
    int beyond = 0;
    switch (op) {
    case MP_BINARY_OP_ADD:
    case MP_BINARY_OP_INPLACE_ADD: beyond = __builtin_add_overflow(a, b, &result); break;
    case MP_BINARY_OP_SUBTRACT:
    case MP_BINARY_OP_INPLACE_SUBTRACT: beyond = __builtin_sub_overflow(a, b, &result); break;
    case MP_BINARY_OP_MULTIPLY:
    case MP_BINARY_OP_INPLACE_MULTIPLY: beyond = __builtin_mul_overflow(a, b, &result); break;
    case MP_BINARY_OP_FLOOR_DIVIDE:
    case MP_BINARY_OP_INPLACE_FLOOR_DIVIDE: result = divided(a, b, &rest); break;
    case MP_BINARY_OP_MODULO:
    case MP_BINARY_OP_INPLACE_MODULO:
        if (b != -1) {
            divided(a, b, &result);
        }
        break;
    case MP_BINARY_OP_DIVMOD: {
        result = divided(a, b, &rest);
        const mp_obj_t both[] = {mp_obj_new_int_from_ll(result), mp_obj_new_int_from_ll(rest)};
        return mp_obj_new_tuple(2, both);
    }
    case MP_BINARY_OP_AND:
    case MP_BINARY_OP_INPLACE_AND: result = a & b; break;
    case MP_BINARY_OP_OR:
    case MP_BINARY_OP_INPLACE_OR: result = a | b; break;
    case MP_BINARY_OP_XOR:
    case MP_BINARY_OP_INPLACE_XOR: result = a ^ b; break;
    case MP_BINARY_OP_LSHIFT:
    case MP_BINARY_OP_INPLACE_LSHIFT: result = shifted_left(a, b); break;
    case MP_BINARY_OP_RSHIFT:
    case MP_BINARY_OP_INPLACE_RSHIFT: result = shifted_right(a, b); break;
    case MP_BINARY_OP_POWER:
    case MP_BINARY_OP_INPLACE_POWER:
        if (b < 0) {
            return mp_obj_float_binary_op(op, (mp_float_t)a, right);
        }
        result = power(a, b);
        break;
    case MP_BINARY_OP_TRUE_DIVIDE:
    case MP_BINARY_OP_INPLACE_TRUE_DIVIDE:
        return b != 0 ? mp_obj_new_float(quotient(a, b)) : mp_obj_float_binary_op(op, 0.0, right);
    case MP_BINARY_OP_LESS: return mp_obj_new_bool(a < b);
    case MP_BINARY_OP_MORE: return mp_obj_new_bool(a > b);
    case MP_BINARY_OP_LESS_EQUAL: return mp_obj_new_bool(a <= b);
    case MP_BINARY_OP_MORE_EQUAL: return mp_obj_new_bool(a >= b);
    case MP_BINARY_OP_EQUAL: return mp_obj_new_bool(a == b);
    default: return MP_OBJ_NULL;
    }
    if (beyond) {
        overflow();
    }
    return mp_obj_new_int_from_ll(result);
}

/* ---- what MicroPython would cut to fewer bits (the toolchain makes it call these) */

/* Of an element of an array. */
void script_check_fits(char typecode, uint64_t object)
{
    if (!mp_obj_is_int(object) || typecode == 'O' || typecode == 'd' || typecode == 'f') {
        return;
    }
    const long long value = value_of(object);
    const int bits = 8 * (int)mp_binary_get_size('@', typecode, NULL);
    const int is_signed = typecode >= 'a';
    const long long most = bits - is_signed > 62 ? INT64_MAX : (1LL << (bits - is_signed)) - 1;
    if (value > most || value < (is_signed ? -most - 1 : 0)) {
        mp_raise_msg_varg(&mp_type_OverflowError, MP_ERROR_TEXT("an element of %d bits cannot be %lld"), bits, value);
    }
}

/* Of a range: its numbers, and how many it has, fit into objects. */
mp_int_t script_range_int(mp_const_obj_t object)
{
    const mp_int_t value = mp_obj_get_int(object), most = (mp_int_t)1 << 45;
    if (value > most - 1 || value < -most) {
        mp_raise_msg(&mp_type_OverflowError, MP_ERROR_TEXT("a range ends at 2**45"));
    }
    return value;
}

/* How often a sequence is repeated, as mp_obj_get_int_maybe(): its size stays a size_t. */
bool script_times(mp_const_obj_t object, mp_int_t *n)
{
    if (!mp_obj_get_int_maybe(object, n)) {
        return false;
    }
    if (*n > 0 && (uint64_t)*n > SIZE_MAX / arena_in_use->size) {
        arena_in_use->wanted = SIZE_MAX;
        m_malloc_fail(SIZE_MAX);
    }
    return true;
}

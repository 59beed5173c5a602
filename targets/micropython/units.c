/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/units.h"

#include "targets/micropython/objects.h"

#include <py/cstack.h>
#include <py/objexcept.h>
#include <py/objlist.h>
#include <py/runtime.h>

#include <string.h>

enum { DIMENSIONS = 8, COMPARED = 7 }; /* rad, the last, is for display */

static const int8_t none[DIMENSIONS];

MP_DEFINE_EXCEPTION(UnitError, ValueError)

// --- texts -----------------------------------------------------------------------------------------

/* The factors whose exponents have this sign, with " " or "/" between them. */
static void print_factors(const mp_print_t *print, const int8_t *dims, int sign, const char *between, int first)
{
    static const char base[DIMENSIONS][4] = {"m", "kg", "s", "A", "K", "mol", "cd", "rad"};
    for (int i = 0; i < DIMENSIONS; i++) {
        const int n = dims[i] * sign;
        if (n > 0) {
            mp_printf(print, first ? "%s" : "%s%s", first ? base[i] : between, base[i]);
            if (n > 1) {
                mp_printf(print, "^%d", n);
            }
            first = 0;
        }
    }
}

void units_print(const mp_print_t *print, const int8_t *dims)
{
    for (uint32_t i = 0; i < fledge_script.n_unit_texts; i++) {
        if (!memcmp(fledge_script.unit_texts[i].dims, dims, DIMENSIONS)) {
            mp_print_str(print, fledge_script.unit_texts[i].text);
            return;
        }
    }
    int above = 0, below = 0;
    for (int i = 0; i < DIMENSIONS; i++) {
        above |= dims[i] > 0;
        below |= dims[i] < 0;
    }
    print_factors(print, dims, 1, " ", 1);
    if (!above && below) {
        mp_print_str(print, "1");
    }
    print_factors(print, dims, -1, "/", 0);
}

static int plain(const int8_t *dims)
{
    return !memcmp(dims, none, COMPARED);
}

static void print_kind(const mp_print_t *print, const int8_t *dims)
{
    if (memcmp(dims, none, DIMENSIONS)) {
        units_print(print, dims);
    } else {
        mp_print_str(print, "a plain number");
    }
}

// --- values ----------------------------------------------------------------------------------------

const ScriptQuantity *units_quantity(mp_obj_t value)
{
    return mp_obj_is_type(value, &script_quantity_type) ? MP_OBJ_TO_PTR(value) : NULL;
}

int units_alike(const int8_t *a, const int8_t *b)
{
    return !memcmp(a, b, COMPARED);
}

bool units_plain_number(mp_obj_t value, mp_float_t *number)
{
    return !units_quantity(value) && mp_obj_get_float_maybe(value, number);
}

static mp_obj_t quantity(mp_obj_t value, const int8_t *dims)
{
    ScriptQuantity *new = mp_obj_malloc(ScriptQuantity, &script_quantity_type);
    new->value = value;
    memcpy(new->dims, dims, DIMENSIONS);
    return MP_OBJ_FROM_PTR(new);
}

/* The items of a list, tuple or array; whether it is one. */
static int items_of(mp_obj_t value, size_t *n, mp_obj_t **items)
{
    value = objects_plain(value);
    if (!mp_obj_is_type(value, &mp_type_list) && !mp_obj_is_type(value, &mp_type_tuple)) {
        return 0;
    }
    mp_obj_get_array(value, n, items);
    return 1;
}

/* Apply an operator to two values of the same shape, or to a value and a number. */
static mp_obj_t zip(mp_binary_op_t op, mp_obj_t a, mp_obj_t b)
{
    mp_cstack_check();
    size_t n = 0, m = 0;
    mp_obj_t *x = NULL, *y = NULL;
    const int rows = items_of(a, &n, &x), others = items_of(b, &m, &y);
    if (!rows && !others) {
        return mp_binary_op(op, a, b);
    }
    if (rows && others && n != m) {
        mp_raise_msg_varg(&mp_type_ValueError, MP_ERROR_TEXT("lists of %d and %d values do not match"), (int)n, (int)m);
    }
    mp_obj_list_t *list = MP_OBJ_TO_PTR(mp_obj_new_list(rows ? n : m, NULL));
    for (size_t i = 0; i < list->len; i++) {
        list->items[i] = zip(op, rows ? x[i] : a, others ? y[i] : b);
    }
    return MP_OBJ_FROM_PTR(list);
}

/* x to the power of n. Of a whole n by products, as python/fledge/units.py. */
static mp_obj_t power(mp_obj_t x, mp_obj_t n, double exponent)
{
    const int whole = exponent >= -1e6 && exponent <= 1e6 && (double)(int)exponent == exponent ? (int)exponent : 0;
    if (!whole) {
        return mp_binary_op(MP_BINARY_OP_POWER, x, n);
    }
    mp_obj_t product = x;
    for (int i = 1; i < (whole < 0 ? -whole : whole); i++) {
        product = mp_binary_op(MP_BINARY_OP_MULTIPLY, product, x);
    }
    return whole > 0 ? product : mp_binary_op(MP_BINARY_OP_TRUE_DIVIDE, MP_OBJ_NEW_SMALL_INT(1), product);
}

typedef enum Change { NEGATIVE, ABSOLUTE, POWER } Change;

/* Change each number of a value. n: for POWER. */
static mp_obj_t map(Change change, mp_obj_t value, mp_obj_t n, double exponent)
{
    mp_cstack_check();
    size_t length;
    mp_obj_t *items;
    if (!items_of(value, &length, &items)) {
        return change == POWER ? power(value, n, exponent)
                               : mp_unary_op(change == NEGATIVE ? MP_UNARY_OP_NEGATIVE : MP_UNARY_OP_ABS, value);
    }
    mp_obj_list_t *list = MP_OBJ_TO_PTR(mp_obj_new_list(length, NULL));
    for (size_t i = 0; i < length; i++) {
        list->items[i] = map(change, items[i], n, exponent);
    }
    return MP_OBJ_FROM_PTR(list);
}

/* The other's value if its dimensions are like these; MP_OBJ_NULL. */
static mp_obj_t like(const ScriptQuantity *self, mp_obj_t other)
{
    const ScriptQuantity *q = units_quantity(other);
    return units_alike(self->dims, q ? q->dims : none) ? (q ? q->value : other) : MP_OBJ_NULL;
}

static mp_obj_t must_be_like(const ScriptQuantity *self, mp_obj_t other, const char *verb)
{
    const mp_obj_t value = like(self, other);
    if (value == MP_OBJ_NULL) {
        const ScriptQuantity *q = units_quantity(other);
        const mp_print_t *error = objects_error();
        mp_printf(error, "cannot %s ", verb);
        print_kind(error, self->dims);
        mp_print_str(error, " and ");
        print_kind(error, q ? q->dims : none);
        objects_raise_as(&mp_type_UnitError);
    }
    return value;
}

// --- operators -------------------------------------------------------------------------------------

static mp_obj_t sum_of(const int8_t *a, const int8_t *b, int sign, mp_obj_t value)
{
    int8_t dims[DIMENSIONS];
    for (int i = 0; i < DIMENSIONS; i++) {
        const int n = a[i] + sign * b[i];
        if (n < INT8_MIN || n > INT8_MAX) {
            mp_raise_msg(&mp_type_UnitError, MP_ERROR_TEXT("an exponent of a unit is beyond 127"));
        }
        dims[i] = (int8_t)n;
    }
    return quantity(value, dims);
}

static mp_obj_t raised(const ScriptQuantity *self, mp_obj_t n)
{
    mp_float_t exponent;
    if (!units_plain_number(n, &exponent)) {
        return MP_OBJ_NULL;
    }
    int8_t dims[DIMENSIONS];
    for (int i = 0; i < DIMENSIONS; i++) {
        const double exact = self->dims[i] * exponent;
        const double near = exact < 0.0 ? exact - 0.5 : exact + 0.5;
        const double off = near >= -127.9 && near <= 127.9 ? exact - (int)near : 1.0;
        if (!(off <= 1e-9 && off >= -1e-9)) {
            const mp_print_t *error = objects_error();
            units_print(error, self->dims);
            mp_print_str(error, " to the power of ");
            mp_obj_print_helper(error, n, PRINT_STR);
            mp_print_str(error, " has no whole exponents");
            objects_raise_as(&mp_type_UnitError);
        }
        dims[i] = (int8_t)(int)near;
    }
    return quantity(map(POWER, self->value, n, exponent), dims);
}

static mp_obj_t binary(mp_binary_op_t op, mp_obj_t left, mp_obj_t right)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(left), *other = units_quantity(right);
    if (objects_is_inert(right)) {
        return right;
    }
    switch (op) {
    case MP_BINARY_OP_MULTIPLY:
        return sum_of(self->dims, other ? other->dims : none, 1,
                      zip(MP_BINARY_OP_MULTIPLY, self->value, other ? other->value : right));
    case MP_BINARY_OP_REVERSE_MULTIPLY: return quantity(zip(MP_BINARY_OP_MULTIPLY, right, self->value), self->dims);
    case MP_BINARY_OP_TRUE_DIVIDE:
        return sum_of(self->dims, other ? other->dims : none, -1,
                      zip(MP_BINARY_OP_TRUE_DIVIDE, self->value, other ? other->value : right));
    case MP_BINARY_OP_REVERSE_TRUE_DIVIDE:
        return sum_of(none, self->dims, -1, zip(MP_BINARY_OP_TRUE_DIVIDE, right, self->value));
    case MP_BINARY_OP_POWER: return raised(self, right);
    case MP_BINARY_OP_ADD:
    case MP_BINARY_OP_REVERSE_ADD:
        return quantity(zip(MP_BINARY_OP_ADD, self->value, must_be_like(self, right, "add")), self->dims);
    case MP_BINARY_OP_SUBTRACT:
        return quantity(zip(MP_BINARY_OP_SUBTRACT, self->value, must_be_like(self, right, "subtract")), self->dims);
    case MP_BINARY_OP_REVERSE_SUBTRACT: {
        const mp_obj_t value = must_be_like(self, right, "add");
        return quantity(zip(MP_BINARY_OP_ADD, map(NEGATIVE, self->value, MP_OBJ_NULL, 0.0), value), self->dims);
    }
    case MP_BINARY_OP_EQUAL: {
        const mp_obj_t value = like(self, right);
        return mp_obj_new_bool(value != MP_OBJ_NULL && mp_obj_equal(self->value, value));
    }
    case MP_BINARY_OP_LESS:
    case MP_BINARY_OP_LESS_EQUAL:
    case MP_BINARY_OP_MORE:
    case MP_BINARY_OP_MORE_EQUAL: return mp_binary_op(op, self->value, must_be_like(self, right, "compare"));
    default: return MP_OBJ_NULL;
    }
}

static mp_obj_t unary(mp_unary_op_t op, mp_obj_t object)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(object);
    size_t n;
    mp_obj_t *items;
    switch (op) {
    case MP_UNARY_OP_BOOL: return mp_obj_new_bool(mp_obj_is_true(self->value));
    case MP_UNARY_OP_LEN: return items_of(self->value, &n, &items) ? MP_OBJ_NEW_SMALL_INT(n) : MP_OBJ_NULL;
    case MP_UNARY_OP_POSITIVE: return object;
    case MP_UNARY_OP_NEGATIVE: return quantity(map(NEGATIVE, self->value, MP_OBJ_NULL, 0.0), self->dims);
    case MP_UNARY_OP_ABS: return quantity(map(ABSOLUTE, self->value, MP_OBJ_NULL, 0.0), self->dims);
    case MP_UNARY_OP_FLOAT_MAYBE:
        if (!plain(self->dims)) {
            const mp_print_t *error = objects_error();
            mp_obj_print_helper(error, object, PRINT_REPR);
            mp_print_str(error, " is not a plain number; write x.to(unit) or x.value");
            objects_raise_as(&mp_type_UnitError);
        }
        return mp_obj_new_float(mp_obj_get_float(self->value));
    default: return MP_OBJ_NULL;
    }
}

static void print(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(object);
    (void)kind;
    mp_obj_print_helper(print, self->value, PRINT_STR);
    if (memcmp(self->dims, none, DIMENSIONS)) {
        mp_print_str(print, " ");
        units_print(print, self->dims);
    }
}

static mp_obj_t subscript(mp_obj_t object, mp_obj_t index, mp_obj_t value)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(object);
    return value == MP_OBJ_SENTINEL ? quantity(mp_obj_subscr(self->value, index, MP_OBJ_SENTINEL), self->dims)
                                    : MP_OBJ_NULL;
}

static void attribute(mp_obj_t object, qstr name, mp_obj_t *dest)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(object);
    if (dest[0] != MP_OBJ_NULL) {
        return;
    }
    if (name == MP_QSTR_value) {
        dest[0] = self->value;
    } else if (name == MP_QSTR_dims) {
        mp_obj_t dims[DIMENSIONS];
        for (int i = 0; i < DIMENSIONS; i++) {
            dims[i] = MP_OBJ_NEW_SMALL_INT(self->dims[i]);
        }
        dest[0] = mp_obj_new_tuple(DIMENSIONS, dims);
    } else {
        dest[1] = MP_OBJ_SENTINEL; /* go on with the methods */
    }
}

static mp_obj_t to(mp_obj_t object, mp_obj_t unit)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(object), *target = units_quantity(unit);
    size_t n;
    mp_obj_t *items;
    if (objects_is_inert(unit)) {
        return unit;
    }
    if (!target || items_of(target->value, &n, &items)) {
        const mp_print_t *error = objects_error();
        mp_print_str(error, "to() needs a unit, as in x.to(km); found ");
        objects_print_found(error, unit);
        objects_raise_as(&mp_type_UnitError);
    }
    must_be_like(self, unit, "convert");
    return zip(MP_BINARY_OP_TRUE_DIVIDE, self->value, target->value);
}
static MP_DEFINE_CONST_FUN_OBJ_2(to_object, to);

static mp_obj_t make(const mp_obj_type_t *type, size_t n, size_t n_keywords, const mp_obj_t *arguments)
{
    (void)type;
    mp_arg_check_num(n, n_keywords, 2, 2, false);
    size_t length;
    mp_obj_t *items;
    mp_obj_get_array(arguments[1], &length, &items);
    int8_t dims[DIMENSIONS];
    if (length != DIMENSIONS) {
        mp_raise_ValueError(MP_ERROR_TEXT("a quantity has 8 exponents"));
    }
    for (int i = 0; i < DIMENSIONS; i++) {
        dims[i] = (int8_t)mp_obj_get_int(items[i]);
    }
    return quantity(arguments[0], dims);
}

static mp_obj_t iterate(mp_obj_t object, mp_obj_iter_buf_t *buffer)
{
    const ScriptQuantity *self = MP_OBJ_TO_PTR(object);
    size_t n;
    mp_obj_t *items;
    if (!items_of(self->value, &n, &items)) {
        mp_raise_TypeError(MP_ERROR_TEXT("a single quantity has no items"));
    }
    return objects_iterate(object, n, buffer);
}

static const mp_rom_map_elem_t methods_table[] = {{MP_ROM_QSTR(MP_QSTR_to), MP_ROM_PTR(&to_object)}};
static MP_DEFINE_CONST_DICT(methods, methods_table);

MP_DEFINE_CONST_OBJ_TYPE(script_quantity_type, MP_QSTR_Quantity,
                         MP_TYPE_FLAG_EQ_CHECKS_OTHER_TYPE | MP_TYPE_FLAG_ITER_IS_GETITER, make_new, make, print, print,
                         unary_op, unary, binary_op, binary, attr, attribute, subscr, subscript, iter, iterate,
                         locals_dict, &methods);

// --- times -----------------------------------------------------------------------------------------

const mp_obj_type_t *units_time(mp_obj_t value, int64_t *ns, const mp_print_t *error)
{
    static const int8_t time[DIMENSIONS] = {0, 0, 1, 0, 0, 0, 0, 0};
    const ScriptQuantity *q = units_quantity(value);
    if (q && !units_alike(q->dims, time)) {
        mp_print_str(error, "expected a time, found ");
        mp_obj_print_helper(error, value, PRINT_STR);
        return &mp_type_UnitError;
    }
    const mp_obj_t number = q ? q->value : value;
    mp_float_t x;
    if (mp_obj_is_bool(number) || mp_obj_is_str(number) || !units_plain_number(number, &x)) {
        mp_print_str(error, "expected a time, such as 10 * s; found ");
        objects_print_found(error, number);
        return &mp_type_UnitError;
    }
    if (!(x - x == 0.0)) {
        mp_print_str(error, "expected a finite time, found ");
        mp_obj_print_helper(error, number, PRINT_STR);
        return &mp_type_ValueError;
    }
    const double product = x * 1e9;
    if (!(x < 1e10 && x > -1e10) || product < -0x1p63 || product >= 0x1p63) {
        mp_print_str(error, "expected a time within 292 years, found ");
        mp_obj_print_helper(error, number, PRINT_STR);
        mp_print_str(error, " s");
        return &mp_type_ValueError;
    }
    if (mp_obj_is_int(number)) {
        *ns = (int64_t)x * 1000000000;
        return NULL;
    }
    /* the nearest; the even one of two */
    int64_t near = (int64_t)product;
    const double rest = product - (double)near;
    near += (rest > 0.5 || (rest == 0.5 && near % 2)) - (rest < -0.5 || (rest == -0.5 && near % 2));
    *ns = near;
    return NULL;
}

static mp_obj_t nanoseconds(mp_obj_t value)
{
    int64_t ns;
    const mp_obj_type_t *fault = units_time(value, &ns, objects_error());
    if (fault) {
        objects_raise_as(fault);
    }
    return mp_obj_new_int_from_ll(ns);
}
static MP_DEFINE_CONST_FUN_OBJ_1(nanoseconds_object, nanoseconds);

// --- the module ------------------------------------------------------------------------------------

static mp_obj_t unit_named(mp_obj_t name)
{
    const char *text = mp_obj_str_get_str(name);
    for (uint32_t i = 0; i < fledge_script.n_units; i++) {
        if (!strcmp(fledge_script.units[i].name, text)) {
            return MP_OBJ_FROM_PTR(&fledge_script.units[i].unit);
        }
    }
    const mp_print_t *error = objects_error();
    mp_printf(error, "fledge.units has no unit '%s'; the units are ", text);
    for (uint32_t i = 0; i < fledge_script.n_units; i++) {
        mp_printf(error, i ? ", %s" : "%s", fledge_script.units[i].name);
    }
    objects_raise_as(&mp_type_ImportError);
}
static MP_DEFINE_CONST_FUN_OBJ_1(unit_named_object, unit_named);

static const mp_rom_map_elem_t module_table[] = {
    {MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_units)},
    {MP_ROM_QSTR(MP_QSTR___getattr__), MP_ROM_PTR(&unit_named_object)},
    {MP_ROM_QSTR(MP_QSTR_Quantity), MP_ROM_PTR(&script_quantity_type)},
    {MP_ROM_QSTR(MP_QSTR_UnitError), MP_ROM_PTR(&mp_type_UnitError)},
    {MP_ROM_QSTR(MP_QSTR_nanoseconds), MP_ROM_PTR(&nanoseconds_object)},
};
static MP_DEFINE_CONST_DICT(module_globals, module_table);

const mp_obj_module_t script_units_module = {.base = {&mp_type_module}, .globals = (mp_obj_dict_t *)&module_globals};

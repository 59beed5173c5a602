/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/composition.h"

#include <py/objtuple.h>

#include <string.h>

typedef struct Condition {
    mp_obj_base_t base;
    ExecutiveCondition condition;
} Condition;

static const mp_obj_type_t condition_type;

mp_obj_t watch_new(ScriptNode *node, const ScriptField *field)
{
    Watch *watch = mp_obj_malloc(Watch, &watch_type);
    watch->node = node;
    watch->field = field;
    watch->index = 0u;
    watch->measure = WHOLE;
    return MP_OBJ_FROM_PTR(watch);
}

static void watch_print(const mp_print_t *print, mp_obj_t self, mp_print_kind_t kind)
{
    (void)kind;
    const Watch *w = MP_OBJ_TO_PTR(self);
    const int reduced = w->measure == EXEC_NORM || w->measure == EXEC_MAX_ABS;
    mp_print_str(print, !reduced ? "" : w->measure == EXEC_NORM ? "norm(" : "max_abs(");
    objects_print_path(print, w->node);
    if (w->field != NULL) {
        mp_printf(print, ".%s", script_field_name(w->field));
    }
    if (w->measure == EXEC_ELEMENT) {
        uint32_t size = 1u;
        for (uint8_t i = 0u; i < w->field->n_dimensions; i++) {
            size *= w->field->shape[i];
        }
        for (uint8_t i = 0u; i < w->field->n_dimensions; i++) {
            size /= w->field->shape[i];
            mp_printf(print, "%s%u", i == 0u ? "[" : ", ", (unsigned)(w->index / size % w->field->shape[i]));
        }
    }
    mp_print_str(print, reduced ? ")" : w->measure == EXEC_ELEMENT ? "]" : "");
}

const char *watch_text(Text *text, const Watch *w)
{
    watch_print(process_text(text), MP_OBJ_FROM_PTR(w), PRINT_REPR);
    return text->text;
}

static void watch_attr(mp_obj_t self, qstr attr, mp_obj_t *dest)
{
    const Watch *w = MP_OBJ_TO_PTR(self);
    Text text;
    if (dest[0] != MP_OBJ_NULL) {
        return; /* a condition changes nothing */
    }
    if (attr == MP_QSTR_norm || attr == MP_QSTR_max_abs) {
        dest[1] = MP_OBJ_SENTINEL;
        return;
    }
    if (w->field == NULL) {
        const ScriptField *field = objects_field(w->node->type, qstr_str(attr));
        if (field == NULL) {
            const mp_print_t *print = objects_error();
            mp_printf(print, "%s has no '%q'; it has ", watch_text(&text, w), attr);
            objects_print_names(print, w->node->type, -1);
            objects_raise();
        }
        const int message = field->type == FLEDGE_STRUCT && field->n_dimensions == 0u;
        dest[0] = message ? watch_new(objects_view(w->node, field, 0), NULL) : watch_new(w->node, field);
    } else if (w->field->type == FLEDGE_STRUCT) {
        objects_refuse("%s is an array of %s; pick one, as in [0]", watch_text(&text, w),
                       script_field_struct(w->field)->name);
    } else {
        objects_refuse("%s is a number or array; it has norm(), max_abs() and [index]", watch_text(&text, w));
    }
}

static Watch *reduce(mp_obj_t self, ExecMeasure measure, const char *reduction)
{
    const Watch *w = MP_OBJ_TO_PTR(self);
    if (w->field == NULL || w->field->n_dimensions == 0u || w->measure != WHOLE) {
        Text text;
        objects_refuse("%s: %s is for arrays", watch_text(&text, w), reduction);
    }
    Watch *other = MP_OBJ_TO_PTR(watch_new(w->node, w->field));
    other->measure = (uint8_t)measure;
    return other;
}

static mp_obj_t watch_norm(mp_obj_t self)
{
    return MP_OBJ_FROM_PTR(reduce(self, EXEC_NORM, "norm()"));
}
static MP_DEFINE_CONST_FUN_OBJ_1(watch_norm_obj, watch_norm);

static mp_obj_t watch_max_abs(mp_obj_t self)
{
    return MP_OBJ_FROM_PTR(reduce(self, EXEC_MAX_ABS, "max_abs()"));
}
static MP_DEFINE_CONST_FUN_OBJ_1(watch_max_abs_obj, watch_max_abs);

static mp_obj_t watch_subscr(mp_obj_t self, mp_obj_t index, mp_obj_t value)
{
    const Watch *w = MP_OBJ_TO_PTR(self);
    const mp_obj_t *indices = &index;
    size_t n = 1u;
    if (value != MP_OBJ_SENTINEL) {
        return MP_OBJ_NULL;
    }
    if (mp_obj_is_type(index, &mp_type_tuple)) {
        mp_obj_t *items;
        mp_obj_tuple_get(index, &n, &items);
        indices = items;
    }
    const int rows = w->field != NULL && w->field->type == FLEDGE_STRUCT;
    Watch *other = rows ? NULL : reduce(self, EXEC_ELEMENT, "[...]");
    mp_int_t i, flat = 0;
    int good = n == (rows ? 1u : w->field->n_dimensions);
    for (size_t k = 0u; good && k < n; k++) {
        good = mp_obj_is_int(indices[k]) && mp_obj_get_int_maybe(indices[k], &i) && i >= 0 && i < w->field->shape[k];
        flat = good ? flat * w->field->shape[k] + i : 0;
    }
    if (!good) {
        const mp_print_t *print = objects_error();
        watch_print(print, self, PRINT_REPR);
        mp_print_str(print, "[");
        objects_print_found(print, index);
        mp_printf(print, "]: expected %d whole numbers, below", rows ? 1 : w->field->n_dimensions);
        for (uint8_t k = 0u; k < (rows ? 1u : w->field->n_dimensions); k++) {
            mp_printf(print, " %d", w->field->shape[k]);
        }
        objects_raise();
    }
    if (rows) {
        return watch_new(objects_view(w->node, w->field, (uint16_t)flat), NULL);
    }
    other->index = (uint32_t)flat;
    return MP_OBJ_FROM_PTR(other);
}

void watch_check_number(const Watch *w, const char *verb)
{
    Text text;
    if (w->field == NULL || w->field->type == FLEDGE_STRUCT) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s: %s one of its fields: ", watch_text(&text, w), verb);
        objects_print_names(print, w->field != NULL ? script_field_struct(w->field) : w->node->type, -1);
        objects_raise();
    }
    if (w->field->type == FLEDGE_CHAR) {
        objects_refuse("%s is a text; %s a number", watch_text(&text, w), verb);
    }
    if (objects_root(w->node)->place < 0) {
        objects_refuse("%s is in no module of %s yet: %s a field of one, as in f.watch(f.name)", watch_text(&text, w),
                       PROCESS, verb);
    }
}

static ExecutiveOperand operand_of(const Watch *w)
{
    watch_check_number(w, "compare");
    if (w->measure == WHOLE && w->field->n_dimensions != 0u) {
        Text text;
        objects_refuse("%s is an array: compare an element, norm() or max_abs()", watch_text(&text, w));
    }
    const uint32_t width = element_size((FledgeType)w->field->type);
    ExecutiveOperand o = {.type = w->field->type, .measure = w->measure == WHOLE ? EXEC_ELEMENT : w->measure};
    o.of.field.offset = process_offset(w->node) + w->field->offset + w->index * width;
    o.of.field.elements = 1u;
    for (uint8_t i = 0u; o.measure != EXEC_ELEMENT && i < w->field->n_dimensions; i++) {
        o.of.field.elements *= w->field->shape[i];
    }
    return o;
}

static int in_ns(const ScriptField *field)
{
    return strcmp(script_field_unit(field)->text, "ns") == 0;
}

/* A constant as a double if that is exact, or else as a whole number. */
static ExecutiveOperand constant_of(const Watch *w, mp_obj_t value)
{
    const ScriptField *field = w->field;
    ExecutiveOperand o = {.constant = 1u, .type = FLEDGE_F64, .measure = EXEC_ELEMENT};
    Text text;
    if (script_field_enum(field) == NULL && (mp_obj_is_int(value) || (in_ns(field) && !mp_obj_is_float(value)))) {
        o.of.whole = mp_obj_is_int(value) ? mp_obj_get_int(value) : objects_time(value, watch_text(&text, w));
        const double real = (double)o.of.whole;
        if (real < 9223372036854775808.0 && (int64_t)real == o.of.whole) {
            o.of.real = real;
        } else {
            o.type = FLEDGE_I64;
        }
    } else {
        o.of.real = objects_constant(field, value, watch_text(&text, w));
        if (!(o.of.real - o.of.real == 0.0)) {
            objects_refuse("%s: expected a finite number to compare it with", watch_text(&text, w));
        }
    }
    return o;
}

static ExecutiveOperand other_of(const Watch *w, const Watch *other)
{
    const ExecutiveOperand o = operand_of(other);
    const ScriptField *a = w->field, *b = other->field;
    Text ours, theirs;
    if (w->node == other->node && a == b && w->index == other->index && w->measure == other->measure) {
        objects_refuse("%s: this compares a field with itself", watch_text(&ours, w));
    }
    if (script_field_enum(a) != script_field_enum(b) ||
        memcmp(script_field_unit(a)->dims, script_field_unit(b)->dims, 7) != 0 || in_ns(a) != in_ns(b)) {
        objects_refuse("%s cannot be compared with %s: the first is in %s, the second in %s", watch_text(&ours, w),
                       watch_text(&theirs, other),
                       script_field_enum(a) != NULL ? script_field_enum(a)->name : script_field_unit(a)->text,
                       script_field_enum(b) != NULL ? script_field_enum(b)->name : script_field_unit(b)->text);
    }
    return o;
}

static mp_obj_t watch_binary(mp_binary_op_t op, mp_obj_t self, mp_obj_t value)
{
    const Watch *w = MP_OBJ_TO_PTR(self);
    ExecRelation relation;
    switch (op) {
    case MP_BINARY_OP_LESS: relation = EXEC_LESS; break;
    case MP_BINARY_OP_LESS_EQUAL: relation = EXEC_LESS_EQUAL; break;
    case MP_BINARY_OP_MORE: relation = EXEC_GREATER; break;
    case MP_BINARY_OP_MORE_EQUAL: relation = EXEC_GREATER_EQUAL; break;
    case MP_BINARY_OP_EQUAL: relation = EXEC_EQUAL; break;
    case MP_BINARY_OP_NOT_EQUAL: relation = EXEC_NOT_EQUAL; break;
    default: return MP_OBJ_NULL;
    }
    ExecutiveCondition c = {.join = EXEC_COMPARE, .relation = (uint8_t)relation, .depth = 1u};
    c.of.operands[0] = operand_of(w);
    c.of.operands[1] = mp_obj_is_type(value, &watch_type) ? other_of(w, MP_OBJ_TO_PTR(value)) : constant_of(w, value);
    Condition *handle = mp_obj_malloc(Condition, &condition_type);
    handle->condition = c;
    return MP_OBJ_FROM_PTR(handle);
}

static mp_obj_t watch_unary(mp_unary_op_t op, mp_obj_t self)
{
    if (op == MP_UNARY_OP_BOOL) {
        Text text;
        objects_refuse("%s is only known when the mission runs; compare it, as in x < 1",
                       watch_text(&text, MP_OBJ_TO_PTR(self)));
    }
    return MP_OBJ_NULL;
}

static const mp_rom_map_elem_t watch_locals_table[] = {
    {MP_ROM_QSTR(MP_QSTR_norm), MP_ROM_PTR(&watch_norm_obj)},
    {MP_ROM_QSTR(MP_QSTR_max_abs), MP_ROM_PTR(&watch_max_abs_obj)},
};
static MP_DEFINE_CONST_DICT(watch_locals, watch_locals_table);

MP_DEFINE_CONST_OBJ_TYPE(watch_type, MP_QSTR_Watch,
                         MP_TYPE_FLAG_EQ_NOT_REFLEXIVE | MP_TYPE_FLAG_EQ_CHECKS_OTHER_TYPE |
                             MP_TYPE_FLAG_EQ_HAS_NEQ_TEST,
                         print, watch_print, attr, watch_attr, subscr, watch_subscr, binary_op, watch_binary, unary_op,
                         watch_unary, locals_dict, &watch_locals);

static mp_obj_t join_conditions(ExecJoin join, const Condition *a, const Condition *b)
{
    Condition *handle = mp_obj_malloc(Condition, &condition_type);
    const unsigned depth =
        b != NULL && b->condition.depth + 1u > a->condition.depth ? b->condition.depth + 1u : a->condition.depth;
    if (depth > EXEC_DEPTH) {
        objects_refuse("a condition nests more than %d deep", EXEC_DEPTH);
    }
    handle->condition = (ExecutiveCondition){.join = (uint8_t)join, .depth = (uint8_t)depth};
    handle->condition.of.parts[0] = &a->condition;
    handle->condition.of.parts[1] = b != NULL ? &b->condition : NULL;
    return MP_OBJ_FROM_PTR(handle);
}

static mp_obj_t condition_binary(mp_binary_op_t op, mp_obj_t a, mp_obj_t b)
{
    if (!mp_obj_is_type(b, &condition_type) || (op != MP_BINARY_OP_AND && op != MP_BINARY_OP_OR)) {
        return MP_OBJ_NULL;
    }
    return join_conditions(op == MP_BINARY_OP_AND ? EXEC_BOTH : EXEC_EITHER, MP_OBJ_TO_PTR(a), MP_OBJ_TO_PTR(b));
}

static mp_obj_t condition_unary(mp_unary_op_t op, mp_obj_t self)
{
    if (op == MP_UNARY_OP_BOOL) {
        objects_refuse("a condition is only known when the mission runs; join conditions with &, | and ~, each in "
                       "parentheses, as in (x > 1) & (x < 2)");
    }
    return op == MP_UNARY_OP_INVERT ? join_conditions(EXEC_INVERSE, MP_OBJ_TO_PTR(self), NULL) : MP_OBJ_NULL;
}

static MP_DEFINE_CONST_OBJ_TYPE(condition_type, MP_QSTR_Condition, MP_TYPE_FLAG_NONE, binary_op, condition_binary,
                                unary_op, condition_unary);

const ExecutiveCondition *watch_condition(mp_obj_t value, const char *subject, const char *key)
{
    if (!mp_obj_is_type(value, &condition_type)) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s: %s takes a condition, as in watch(port).field < 1; found ", subject, key);
        objects_print_found(print, value);
        objects_raise();
    }
    return &((Condition *)MP_OBJ_TO_PTR(value))->condition;
}

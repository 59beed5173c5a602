/* SPDX-License-Identifier: Apache-2.0 */
/* Modules, messages, structs and arrays as views of C memory, by the tables of a mission. Assignments accept what the
 * desktop's objects accept (python/fledge/core/store.cpp). */
#include <stdarg.h> /* first: mp_vprintf is declared where va_start is */

#include "targets/micropython/objects.h"

#include "flight/exec/message.h"
#include "targets/micropython/assign.h"
#include "targets/micropython/script.h"
#include "targets/micropython/update.h"

#include <py/objexcept.h>
#include <py/objlist.h>
#include <py/runtime.h>

#include <string.h>

MP_DEFINE_EXCEPTION(SetupError, ValueError)

// --- texts of errors -------------------------------------------------------------------------------

static char message[480]; /* static, so that an error under the lock has its text */
static ScriptText message_end = {message, sizeof message, 0};
static mp_print_t appended;

const mp_print_t *objects_error(void)
{
    appended = script_text(&message_end);
    return &appended;
}

void objects_raise_as(const mp_obj_type_t *type)
{
    mp_raise_msg_varg(type, MP_ERROR_TEXT("%s"), message);
}

void objects_raise(void)
{
    objects_raise_as(&mp_type_SetupError);
}

void objects_refuse(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    mp_vprintf(objects_error(), format, arguments);
    va_end(arguments);
    objects_raise();
}

typedef struct Shown {
    const mp_print_t *print;
    uint32_t room;
} Shown;

static void show(void *data, const char *text, size_t n)
{
    Shown *shown = data;
    for (; n && shown->room; text++, n--) {
        mp_print_strn(shown->print, *text == '\n' ? " " : text, 1, 0, ' ', 0);
        if (!--shown->room) {
            mp_print_str(shown->print, "...");
        }
    }
}

void objects_print_found(const mp_print_t *print, mp_obj_t value)
{
    Shown shown = {print, 77};
    const mp_print_t short_print = {&shown, show};
    mp_obj_print_helper(&short_print, value, PRINT_REPR);
}

void objects_print_names(const mp_print_t *print, const ScriptType *type, int group)
{
    const char *between = "";
    for (uint32_t i = 0; i < type->n; i++) {
        if (group < 0 || type->fields[i].group == group) {
            mp_printf(print, "%s%s", between, script_field_name(&type->fields[i]));
            between = ", ";
        }
    }
    if (!*between) {
        mp_print_str(print, "(none)");
    }
}

static void refuse_name(const ScriptNode *node, qstr name)
{
    static const char *const words[] = {"fields", "inputs", "outputs", "parameters", "memory"};
    static const uint8_t order[] = {SCRIPT_PAR, SCRIPT_IN, SCRIPT_OUT, SCRIPT_MEM, SCRIPT_NONE};
    const mp_print_t *error = objects_error();
    objects_print_path(error, node);
    mp_printf(error, " has no attribute '%q'; ", name);
    const char *between = "";
    for (uint32_t i = 0; i < sizeof order; i++) {
        int has = 0;
        for (uint32_t k = 0; k < node->type->n; k++) {
            has |= node->type->fields[k].group == order[i];
        }
        if (has) {
            mp_printf(error, "%s%s: ", between, words[order[i]]);
            objects_print_names(error, node->type, order[i]);
            between = "; ";
        }
    }
}

// --- the tree of views -----------------------------------------------------------------------------

static ScriptNode *node_of(mp_obj_t value)
{
    const mp_obj_type_t *type = mp_obj_get_type(value);
    return type == &script_module_type || type == &script_view_type || type == &script_array_type ? MP_OBJ_TO_PTR(value)
                                                                                                  : NULL;
}

ScriptNode *objects_struct(mp_obj_t value)
{
    ScriptNode *node = node_of(value);
    return node && node->type ? node : NULL;
}

ScriptRoot *objects_module(mp_obj_t value)
{
    ScriptNode *node = objects_struct(value);
    return node && objects_is_module(node) ? (ScriptRoot *)node : NULL;
}

const ScriptField *objects_field(const ScriptType *type, const char *name)
{
    for (uint32_t i = 0; i < type->n; i++) {
        if (!strcmp(script_field_name(&type->fields[i]), name)) {
            return &type->fields[i];
        }
    }
    return NULL;
}

const ScriptField *objects_field_of(const ScriptNode *node)
{
    return node->owner ? &node->owner->type->fields[node->field] : NULL;
}

uint32_t objects_rows(const ScriptNode *owner, const ScriptField *field)
{
    const uint32_t all = field->shape[0];
    if (field->count == SCRIPT_NO_FIELD) {
        return all;
    }
    const ScriptField *count = &owner->type->fields[field->count];
    const double n = element_read((FledgeType)count->type, objects_memory(owner) + count->offset);
    return n < all ? (uint32_t)n : all;
}

void objects_print_path(const mp_print_t *print, const ScriptNode *node)
{
    if (!node->owner) {
        const int place = ((const ScriptRoot *)node)->place;
        if (place < 0) {
            mp_print_str(print, node->type->name);
        } else {
            mp_printf(print, "%s.%s", fledge_script.process, fledge_script.places[place].name);
        }
        return;
    }
    const ScriptField *field = objects_field_of(node);
    objects_print_path(print, node->owner);
    mp_printf(print, ".%s", script_field_name(field));
    if (node->type && field->n_dimensions) {
        mp_printf(print, "[%d]", (int)node->row);
    }
}

static ScriptNode *view_of(ScriptNode *owner, uint32_t index, uint32_t level, uint32_t row)
{
    for (ScriptNode *view = owner->views; view; view = view->next) {
        if (view->field == index && view->level == level && view->row == row) {
            return view;
        }
    }
    const ScriptField *field = &owner->type->fields[index];
    const int is_struct = field->type == FLEDGE_STRUCT && level == field->n_dimensions;
    ScriptNode *view = mp_obj_malloc(ScriptNode, is_struct ? &script_view_type : &script_array_type);
    *view = (ScriptNode){.base = view->base,
                         .owner = owner,
                         .next = owner->views,
                         .field = (uint16_t)index,
                         .row = (uint16_t)row,
                         .level = (uint8_t)level,
                         .type = is_struct ? script_field_struct(field) : NULL,
                         .offset = owner->offset + field->offset + row * objects_stride(field, level)};
    owner->views = view;
    return view;
}

uint32_t objects_stride(const ScriptField *field, uint32_t level)
{
    uint32_t size =
        field->type == FLEDGE_STRUCT ? script_field_struct(field)->size : element_size((FledgeType)field->type);
    for (uint32_t i = level; i < field->n_dimensions; i++) {
        size *= field->shape[i];
    }
    return size;
}

ScriptNode *objects_view(ScriptNode *owner, const ScriptField *field, uint16_t row)
{
    return view_of(owner, (uint32_t)(field - owner->type->fields), field->n_dimensions, row);
}

void objects_make_views(ScriptNode *node)
{
    for (uint32_t i = 0; i < node->type->n; i++) {
        const ScriptField *field = &node->type->fields[i];
        if (field->type == FLEDGE_CHAR || (!field->n_dimensions && field->type != FLEDGE_STRUCT)) {
            continue;
        }
        ScriptNode *view = view_of(node, i, 0, 0);
        if (view->type) {
            objects_make_views(view);
        } else if (field->n_dimensions > 1 || field->type == FLEDGE_STRUCT) {
            for (uint32_t row = 0; row < field->shape[0]; row++) {
                ScriptNode *part = view_of(node, i, 1, row);
                if (part->type) {
                    objects_make_views(part);
                }
            }
        }
    }
}

// --- reading ---------------------------------------------------------------------------------------

static mp_obj_t number_at(const ScriptField *field, const uint8_t *p)
{
    int64_t i = 0;
    uint64_t u = 0;
    switch (field->type) {
    case FLEDGE_F64:
    case FLEDGE_F32: return mp_obj_new_float(element_read((FledgeType)field->type, p));
    case FLEDGE_I64: memcpy(&i, p, sizeof i); return mp_obj_new_int_from_ll(i);
    case FLEDGE_U64: memcpy(&u, p, sizeof u); return mp_obj_new_int_from_ull(u);
    default: return MP_OBJ_NEW_SMALL_INT((mp_int_t)element_read((FledgeType)field->type, p));
    }
}

static mp_obj_t value_of(ScriptNode *node, const ScriptField *field)
{
    const uint8_t *p = objects_memory(node) + field->offset;
    if (field->type == FLEDGE_CHAR) {
        const char *end = memchr(p, 0, objects_stride(field, 0));
        return mp_obj_new_str((const char *)p, end ? (size_t)(end - (const char *)p) : objects_stride(field, 0));
    }
    return field->type == FLEDGE_STRUCT || field->n_dimensions
               ? MP_OBJ_FROM_PTR(view_of(node, (uint32_t)(field - node->type->fields), 0, 0))
               : number_at(field, p);
}

static void attribute(mp_obj_t object, qstr name, mp_obj_t *dest)
{
    ScriptNode *node = MP_OBJ_TO_PTR(object);
    const ScriptField *field = objects_field(node->type, qstr_str(name));
    if (dest[0] == MP_OBJ_NULL) {
        if (field) {
            dest[0] = value_of(node, field);
            return;
        }
        const mp_obj_type_t *type = mp_obj_get_type(object);
        if ((MP_OBJ_TYPE_HAS_SLOT(type, locals_dict) &&
             mp_map_lookup(&MP_OBJ_TYPE_GET_SLOT(type, locals_dict)->map, MP_OBJ_NEW_QSTR(name), MP_MAP_LOOKUP)) ||
            qstr_str(name)[0] == '_') {
            dest[1] = MP_OBJ_SENTINEL; /* go on with the methods */
            return;
        }
    } else if (field && dest[1] != MP_OBJ_NULL) {
        objects_store(node, field, dest[1]);
        dest[0] = MP_OBJ_NULL;
        return;
    } else if (field) {
        objects_print_path(objects_error(), node);
        mp_printf(&appended, ".%q cannot be deleted", name);
        objects_raise_as(&mp_type_AttributeError);
    }
    refuse_name(node, name);
    objects_raise_as(&mp_type_AttributeError);
}

static void print_value(const mp_print_t *print, ScriptNode *node, const ScriptField *field)
{
    if (field->type == FLEDGE_STRUCT) {
        mp_print_str(print, script_field_struct(field)->name);
    } else {
        mp_obj_print_helper(print, value_of(node, field), PRINT_REPR);
    }
}

static void print_struct(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    (void)kind;
    ScriptNode *node = MP_OBJ_TO_PTR(object);
    objects_print_path(print, node);
    mp_print_str(print, "(");
    for (uint32_t i = 0; i < node->type->n; i++) {
        mp_printf(print, "%s%s=", i ? ", " : "", script_field_name(&node->type->fields[i]));
        print_value(print, node, &node->type->fields[i]);
    }
    mp_print_str(print, ")");
}

// --- arrays ----------------------------------------------------------------------------------------

static uint32_t length_of(const ScriptNode *node)
{
    const ScriptField *field = objects_field_of(node);
    return node->level ? field->shape[node->level] : objects_rows(node->owner, field);
}

static mp_obj_t item_of(ScriptNode *node, uint32_t i)
{
    const ScriptField *field = objects_field_of(node);
    const uint32_t level = node->level + 1u, row = (node->level ? node->row * field->shape[node->level] : 0u) + i;
    return level < field->n_dimensions || field->type == FLEDGE_STRUCT
               ? MP_OBJ_FROM_PTR(view_of(node->owner, node->field, level, row))
               : number_at(field, objects_memory(node) + i * element_size((FledgeType)field->type));
}

static mp_obj_t list_of(ScriptNode *node)
{
    mp_obj_list_t *list = MP_OBJ_TO_PTR(mp_obj_new_list(length_of(node), NULL));
    for (uint32_t i = 0; i < list->len; i++) {
        list->items[i] = objects_plain(item_of(node, i));
    }
    return MP_OBJ_FROM_PTR(list);
}

mp_obj_t objects_plain(mp_obj_t value)
{
    return mp_obj_is_type(value, &script_array_type) ? list_of(MP_OBJ_TO_PTR(value)) : value;
}

static mp_obj_t array_tolist(mp_obj_t object)
{
    return list_of(MP_OBJ_TO_PTR(object));
}
static MP_DEFINE_CONST_FUN_OBJ_1(tolist_object, array_tolist);

static void print_array(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    (void)kind;
    ScriptNode *node = MP_OBJ_TO_PTR(object);
    for (uint32_t i = 0; i < length_of(node); i++) {
        mp_print_str(print, i ? ", " : "[");
        mp_obj_print_helper(print, item_of(node, i), PRINT_REPR);
    }
    mp_print_str(print, length_of(node) ? "]" : "[]");
}

/* Assign to the item i, or to all of its numbers. */
static void store_item(ScriptNode *node, uint32_t i, mp_obj_t value)
{
    const ScriptField *field = objects_field_of(node);
    if (field->type == FLEDGE_STRUCT) {
        mp_raise_TypeError(MP_ERROR_TEXT("assign to the fields of an item, or to the whole array"));
    }
    if (node->level + 1u == field->n_dimensions) {
        assign_element(node->owner, field,
                       node->offset - node->owner->offset + i * objects_stride(field, node->level + 1u), value);
        return;
    }
    ScriptNode *row = MP_OBJ_TO_PTR(item_of(node, i));
    const uint32_t n = length_of(row);
    for (uint32_t k = 0; k < n; k++) {
        store_item(row, k, assign_item(value, k, n));
    }
}

static mp_obj_t array_subscript(mp_obj_t object, mp_obj_t index, mp_obj_t value)
{
    ScriptNode *node = MP_OBJ_TO_PTR(object);
    const uint32_t n = length_of(node);
    if (value == MP_OBJ_NULL) {
        return MP_OBJ_NULL; /* items cannot be deleted */
    }
    if (mp_obj_is_type(index, &mp_type_tuple)) {
        size_t depth;
        mp_obj_t *indices;
        mp_obj_get_array(index, &depth, &indices);
        for (size_t i = 0; i + 1 < depth; i++) {
            object = mp_obj_subscr(object, indices[i], MP_OBJ_SENTINEL);
        }
        return depth ? mp_obj_subscr(object, indices[depth - 1], value) : MP_OBJ_NULL;
    }
    if (mp_obj_is_type(index, &mp_type_slice)) {
        mp_bound_slice_t slice;
        mp_obj_slice_indices(index, n, &slice);
        const mp_int_t step = slice.step;
        const mp_int_t span = step > 0 ? slice.stop - slice.start : slice.start - slice.stop,
                       by = step > 0 ? step : -step;
        const uint32_t items = span > 0 ? (uint32_t)((span + by - 1) / by) : 0u;
        mp_obj_list_t *list = value == MP_OBJ_SENTINEL ? MP_OBJ_TO_PTR(mp_obj_new_list(items, NULL)) : NULL;
        for (uint32_t i = 0; i < items; i++) {
            const uint32_t at = (uint32_t)(slice.start + (mp_int_t)i * step);
            if (list) {
                list->items[i] = item_of(node, at);
            } else {
                store_item(node, at, assign_item(value, i, items));
            }
        }
        return list ? MP_OBJ_FROM_PTR(list) : mp_const_none;
    }
    const uint32_t i = (uint32_t)mp_get_index(mp_obj_get_type(object), n, index, false);
    if (value == MP_OBJ_SENTINEL) {
        return item_of(node, i);
    }
    store_item(node, i, value);
    return mp_const_none;
}

static mp_obj_t array_unary(mp_unary_op_t op, mp_obj_t object)
{
    return op == MP_UNARY_OP_LEN    ? MP_OBJ_NEW_SMALL_INT(length_of(MP_OBJ_TO_PTR(object)))
           : op == MP_UNARY_OP_BOOL ? mp_obj_new_bool(length_of(MP_OBJ_TO_PTR(object)) > 0)
                                    : MP_OBJ_NULL;
}

typedef struct Iterator {
    mp_obj_base_t base;
    mp_fun_1_t next;
    mp_obj_t object;
    uint32_t i, n;
} Iterator;

static mp_obj_t next_item(mp_obj_t object)
{
    Iterator *self = MP_OBJ_TO_PTR(object);
    return self->i < self->n ? mp_obj_subscr(self->object, MP_OBJ_NEW_SMALL_INT(self->i++), MP_OBJ_SENTINEL)
                             : MP_OBJ_STOP_ITERATION;
}

mp_obj_t objects_iterate(mp_obj_t object, size_t n, mp_obj_iter_buf_t *buffer)
{
    Iterator *self = (Iterator *)buffer;
    MP_STATIC_ASSERT(sizeof *self <= sizeof *buffer);
    *self = (Iterator){{&mp_type_polymorph_iter}, next_item, object, 0, (uint32_t)n};
    return MP_OBJ_FROM_PTR(self);
}

static mp_obj_t array_iterate(mp_obj_t object, mp_obj_iter_buf_t *buffer)
{
    return objects_iterate(object, length_of(MP_OBJ_TO_PTR(object)), buffer);
}

static const mp_rom_map_elem_t array_methods_table[] = {{MP_ROM_QSTR(MP_QSTR_tolist), MP_ROM_PTR(&tolist_object)}};
static MP_DEFINE_CONST_DICT(array_methods, array_methods_table);

MP_DEFINE_CONST_OBJ_TYPE(script_array_type, MP_QSTR_array, MP_TYPE_FLAG_ITER_IS_GETITER, print, print_array, unary_op,
                         array_unary, subscr, array_subscript, iter, array_iterate, locals_dict, &array_methods);

// --- wires -----------------------------------------------------------------------------------------

static const char *const choices[] = {"", "newest", "first", "best", "by_mode"};

static void print_choice(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    (void)kind;
    const ScriptChoice *choice = MP_OBJ_TO_PTR(object);
    mp_print_str(print, choices[choice->by]);
    mp_print_str(print, choice->by ? "(" : "");
    for (uint32_t i = 0; i < choice->n; i++) {
        mp_print_str(print, i ? ", " : "");
        if (choice->of[i].mode) {
            mp_printf(print, "%s=", choice->of[i].mode);
        }
        objects_print_path(print, choice->of[i].output);
    }
    mp_print_str(print, choice->by ? ")" : "");
}

static void print_wire(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    const ScriptWire *wire = MP_OBJ_TO_PTR(object);
    print_choice(print, MP_OBJ_FROM_PTR(wire->source), kind);
    for (uint32_t i = 0; i < wire->n; i++) {
        mp_print_str(print, i ? ", " : " >> ");
        objects_print_path(print, wire->targets[i]);
    }
}

static mp_obj_t wire_latency(mp_obj_t object, mp_obj_t exchanges)
{
    ScriptWire *wire = MP_OBJ_TO_PTR(object);
    const mp_int_t n = mp_obj_get_int(exchanges);
    if (n < 0 || n > 1) {
        print_wire(objects_error(), object, PRINT_STR);
        mp_print_str(&appended, ": latency must be 0 or 1 exchange");
        objects_raise();
    }
    wire->latency = (int32_t)n;
    return object;
}
static MP_DEFINE_CONST_FUN_OBJ_2(wire_latency_object, wire_latency);

static mp_obj_t wire_stale_after(mp_obj_t object, mp_obj_t age)
{
    ((ScriptWire *)MP_OBJ_TO_PTR(object))->stale_after = objects_time(age, "stale_after");
    return object;
}
static MP_DEFINE_CONST_FUN_OBJ_2(wire_stale_after_object, wire_stale_after);

static const mp_rom_map_elem_t wire_methods_table[] = {
    {MP_ROM_QSTR(MP_QSTR_latency), MP_ROM_PTR(&wire_latency_object)},
    {MP_ROM_QSTR(MP_QSTR_stale_after), MP_ROM_PTR(&wire_stale_after_object)},
};
static MP_DEFINE_CONST_DICT(wire_methods, wire_methods_table);

MP_DEFINE_CONST_OBJ_TYPE(script_wire_type, MP_QSTR_Wire, MP_TYPE_FLAG_NONE, print, print_wire, locals_dict,
                         &wire_methods);

/* Refuses with "flight.a.out >> flight.b.in: " in front. */
static const mp_print_t *wire_error(const ScriptNode *source, const ScriptNode *target)
{
    const mp_print_t *error = objects_error();
    objects_print_path(error, source);
    mp_print_str(error, " >> ");
    if (target) {
        objects_print_path(error, target);
        mp_print_str(error, ": ");
    }
    return error;
}

static void check_port(const ScriptNode *source, const ScriptNode *target, const ScriptNode *port, int group)
{
    static const char *const words[] = {"", "input", "output"};
    const ScriptField *field = objects_field_of(port);
    const ScriptNode *root = &objects_root(port)->node;
    if (field && root == port->owner && objects_is_module(root) && field->group == group) {
        return;
    }
    const mp_print_t *error = wire_error(source, target);
    objects_print_path(error, port);
    mp_printf(error, " is no %s", words[group]);
    if (objects_is_module(root)) {
        mp_print_str(error, "; ");
        objects_print_path(error, root);
        mp_printf(error, " has the %ss ", words[group]);
        objects_print_names(error, root->type, group);
    }
    objects_raise();
}

static ScriptNode *wire_target(const ScriptNode *source, mp_obj_t value)
{
    ScriptNode *target = objects_struct(value);
    if (!target) {
        objects_print_found(wire_error(source, NULL), value);
        mp_print_str(&appended, ": expected an input or a list of inputs");
        objects_raise();
    }
    if (objects_is_module(target)) {
        mp_print_str(wire_error(source, target), "name an input, not the module; it has the inputs ");
        objects_print_names(&appended, target->type, SCRIPT_IN);
        objects_raise();
    }
    check_port(source, target, source, SCRIPT_OUT);
    check_port(source, target, target, SCRIPT_IN);
    if (source->type != target->type) {
        mp_printf(wire_error(source, target), "the output is %s, the input takes %s", source->type->name,
                  target->type->name);
        objects_raise();
    }
    return target;
}

static mp_obj_t make_wire(const ScriptChoice *source, mp_obj_t right)
{
    if (objects_is_inert(right)) {
        return right;
    }
    size_t n = 1;
    mp_obj_t *items = &right;
    if (mp_obj_is_type(right, &mp_type_list)) {
        mp_obj_get_array(right, &n, &items);
    }
    ScriptWire *wire = m_malloc(sizeof *wire + n * sizeof *wire->targets);
    *wire = (ScriptWire){.base = {&script_wire_type}, .source = source};
    for (size_t i = 0; i < n; i++) {
        if (!objects_is_inert(items[i])) {
            for (uint32_t k = 0; k < source->n; k++) {
                wire->targets[wire->n] = wire_target(source->of[k].output, items[i]);
            }
            wire->n++;
        }
    }
    return MP_OBJ_FROM_PTR(wire);
}

static mp_obj_t choice_binary(mp_binary_op_t op, mp_obj_t left, mp_obj_t right)
{
    return op == MP_BINARY_OP_RSHIFT ? make_wire(MP_OBJ_TO_PTR(left), right) : MP_OBJ_NULL;
}

static MP_DEFINE_CONST_OBJ_TYPE(choice_type, MP_QSTR_Choice, MP_TYPE_FLAG_NONE, print, print_choice, binary_op,
                                choice_binary);

static ScriptChoice *new_choice(ExecChoice by, size_t n)
{
    ScriptChoice *choice = m_malloc0(sizeof *choice + n * sizeof *choice->of);
    *choice = (ScriptChoice){.base = {&choice_type}, .by = by, .n = (uint32_t)n};
    return choice;
}

static mp_obj_t view_binary(mp_binary_op_t op, mp_obj_t left, mp_obj_t right)
{
    if (op != MP_BINARY_OP_RSHIFT || objects_is_inert(right)) {
        return op != MP_BINARY_OP_RSHIFT ? MP_OBJ_NULL : right;
    }
    ScriptChoice *source = new_choice(EXEC_SOLE, 1);
    source->of[0].output = MP_OBJ_TO_PTR(left);
    return make_wire(source, right);
}

/* args: outputs; of by_mode, n names with an output behind each. */
static mp_obj_t choose(ExecChoice by, size_t n, const mp_obj_t *args)
{
    const size_t step = by == EXEC_IN_MODE ? 2u : 1u;
    ScriptChoice *choice = new_choice(by, n);
    for (size_t i = 0; i < n; i++) {
        const mp_obj_t output = args[step * i + step - 1u];
        if (objects_is_inert(output)) {
            return output; /* of another process, as its reader */
        }
        ScriptNode *node = objects_struct(output);
        if (!node || objects_is_module(node)) {
            mp_printf(objects_error(), "%s: expected outputs, as in %s(a.torque, b.torque); found ", choices[by],
                      choices[by]);
            objects_print_found(&appended, output);
            objects_raise();
        }
        choice->of[i].output = node;
        choice->of[i].mode = by == EXEC_IN_MODE ? mp_obj_str_get_str(args[step * i]) : NULL;
    }
    for (size_t i = 0; i < n && by != EXEC_IN_MODE; i++) {
        for (size_t k = 0; k < i; k++) {
            if (choice->of[i].output == choice->of[k].output) {
                print_choice(objects_error(), MP_OBJ_FROM_PTR(choice), PRINT_STR);
                mp_print_str(&appended, ": ");
                objects_print_path(&appended, choice->of[i].output);
                mp_print_str(&appended, " stands in it twice");
                objects_raise();
            }
        }
    }
    if (n < 2u) {
        print_choice(objects_error(), MP_OBJ_FROM_PTR(choice), PRINT_STR);
        mp_print_str(&appended, ": expected two outputs or more");
        objects_raise();
    }
    return MP_OBJ_FROM_PTR(choice);
}

static mp_obj_t newest(size_t n, const mp_obj_t *args)
{
    return choose(EXEC_NEWEST, n, args);
}
MP_DEFINE_CONST_FUN_OBJ_VAR(script_newest, 0, newest);

static mp_obj_t first(size_t n, const mp_obj_t *args)
{
    return choose(EXEC_FIRST, n, args);
}
MP_DEFINE_CONST_FUN_OBJ_VAR(script_first, 0, first);

static mp_obj_t best(size_t n, const mp_obj_t *args)
{
    return choose(EXEC_BEST, n, args);
}
MP_DEFINE_CONST_FUN_OBJ_VAR(script_best, 0, best);

static mp_obj_t by_mode(size_t n, const mp_obj_t *args, mp_map_t *keywords)
{
    (void)args;
    if (n > 0u) {
        objects_refuse("by_mode: name the modes, as in by_mode(safe=a.torque, point=b.torque)");
    }
    mp_obj_t *pairs = m_new(mp_obj_t, 2u * keywords->used);
    size_t used = 0;
    for (size_t i = 0; i < keywords->alloc; i++) {
        if (mp_map_slot_is_filled(keywords, i)) {
            pairs[2u * used] = keywords->table[i].key;
            pairs[2u * used++ + 1u] = keywords->table[i].value;
        }
    }
    return choose(EXEC_IN_MODE, used, pairs);
}
MP_DEFINE_CONST_FUN_OBJ_KW(script_by_mode, 0, by_mode);

MP_DEFINE_CONST_OBJ_TYPE(script_view_type, MP_QSTR_Message, MP_TYPE_FLAG_NONE, print, print_struct, attr, attribute,
                         binary_op, view_binary);

// --- modules, and messages of their own --------------------------------------------------------------

static mp_obj_t module_reset(mp_obj_t object)
{
    const ScriptRoot *module = MP_OBJ_TO_PTR(object);
    if (objects_is_module(&module->node)) {
        objects_check(module);
        module->node.type->reset(module->memory);
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_1(module_reset_object, module_reset);

static mp_obj_t module_update(size_t n, const mp_obj_t *arguments)
{
    const ScriptRoot *module = MP_OBJ_TO_PTR(arguments[0]);
    if (module->update != MP_OBJ_NULL) {
        objects_refuse("%s.update: it is Python; the task that runs it calls it", module->node.type->name);
    }
    if (objects_is_module(&module->node)) {
        module->node.type->update(module->memory, (Tick){n > 1 ? objects_time(arguments[1], "update: t") : 0,
                                                         n > 2 ? objects_time(arguments[2], "update: dt") : 0});
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_VAR_BETWEEN(module_update_object, 1, 3, module_update);

static const mp_rom_map_elem_t module_methods_table[] = {
    {MP_ROM_QSTR(MP_QSTR_held), MP_ROM_PTR(&update_held_object)},
    {MP_ROM_QSTR(MP_QSTR_publish), MP_ROM_PTR(&update_publish_object)},
    {MP_ROM_QSTR(MP_QSTR_reset), MP_ROM_PTR(&module_reset_object)},
    {MP_ROM_QSTR(MP_QSTR_update), MP_ROM_PTR(&module_update_object)},
};
static MP_DEFINE_CONST_DICT(module_methods, module_methods_table);

MP_DEFINE_CONST_OBJ_TYPE(script_module_type, MP_QSTR_Module, MP_TYPE_FLAG_NONE, print, print_struct, attr, attribute,
                         locals_dict, &module_methods);

/* `update=`, `reset=` or `turns=` of a module: takes it from the keywords. MP_OBJ_NULL: it is not there. */
static mp_obj_t keyword_of(const ScriptType *type, mp_map_t *keywords, qstr name, qstr *apart)
{
    mp_map_elem_t *entry = type->reset ? mp_map_lookup(keywords, MP_OBJ_NEW_QSTR(name), MP_MAP_LOOKUP) : NULL;
    *apart = entry ? name : MP_QSTRnull;
    if (!entry || entry->value == mp_const_none) {
        return MP_OBJ_NULL;
    }
    const int turns = name == MP_QSTR_turns;
    if (turns ? !mp_obj_is_small_int(entry->value) || MP_OBJ_SMALL_INT_VALUE(entry->value) < 1 ||
                    MP_OBJ_SMALL_INT_VALUE(entry->value) > INT32_MAX
              : !mp_obj_is_callable(entry->value)) {
        mp_printf(objects_error(), "%s.%q: expected %s; found ", type->name, name,
                  turns ? "a whole number from 1 to 2^31 - 1" : "a function");
        objects_print_found(&appended, entry->value);
        objects_raise();
    }
    return entry->value;
}

static mp_obj_t make_object(mp_obj_t class, size_t n, size_t n_keywords, const mp_obj_t *arguments)
{
    const ScriptType *type = MP_OBJ_TO_PTR(class);
    if (n) {
        mp_raise_msg_varg(&mp_type_TypeError, MP_ERROR_TEXT("%s takes keywords only"), type->name);
    }
    mp_map_t keywords;
    mp_map_init_fixed_table(&keywords, n_keywords, arguments);
    qstr apart[3];
    const mp_obj_t update = keyword_of(type, &keywords, MP_QSTR_update, &apart[0]);
    const mp_obj_t reset = keyword_of(type, &keywords, MP_QSTR_reset, &apart[1]);
    const mp_obj_t turns = keyword_of(type, &keywords, MP_QSTR_turns, &apart[2]);
    if (update == MP_OBJ_NULL && (reset != MP_OBJ_NULL || turns != MP_OBJ_NULL)) {
        objects_refuse("%s: %s= goes with update=, the module's update in Python", type->name,
                       reset != MP_OBJ_NULL ? "reset" : "turns");
    }
    ScriptRoot *root = m_malloc0(sizeof *root + type->n / 8u);
    root->node.base.type = &script_module_type;
    root->node.type = type;
    root->place = -1;
    root->update = update;
    root->reset = reset;
    root->turns = turns != MP_OBJ_NULL ? (uint32_t)MP_OBJ_SMALL_INT_VALUE(turns) : (uint32_t)UPDATE_TURNS;
    root->memory = m_malloc0(type->size);
    const qstr unknown = assign_all(&root->node, &keywords, apart);
    if (unknown != MP_QSTRnull) {
        refuse_name(&root->node, unknown);
        objects_raise_as(&mp_type_TypeError);
    }
    return MP_OBJ_FROM_PTR(root);
}

static void print_class(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    (void)kind;
    mp_print_str(print, ((const ScriptType *)MP_OBJ_TO_PTR(object))->name);
}

MP_DEFINE_CONST_OBJ_TYPE(script_class_type, MP_QSTR_type, MP_TYPE_FLAG_NONE, print, print_class, call, make_object);

void objects_place(mp_obj_t object, uint16_t place)
{
    ScriptRoot *module = objects_module(object);
    const ScriptPlace *at = &fledge_script.places[place];
    const mp_print_t *error = objects_error();
    mp_printf(error, "%s.%s: ", fledge_script.process, at->name);
    if (!module) {
        mp_print_str(error, "expected a module; found ");
        objects_print_found(error, object);
        objects_raise();
    }
    if (module->place >= 0) {
        mp_print_str(error, "this module is ");
        objects_print_path(error, &module->node);
        mp_print_str(error, " already");
        objects_raise();
    }
    if (module->node.type != at->type) {
        mp_printf(error, "on the desktop it is a %s; found a %s", at->type->name, module->node.type->name);
        objects_raise();
    }
    uint8_t *memory = (uint8_t *)fledge_script.memory + at->offset;
    memcpy(memory, module->memory, at->type->size);
    m_del(uint8_t, module->memory, at->type->size);
    module->memory = memory;
    module->place = (int16_t)place;
}

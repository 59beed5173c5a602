/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/assign.h"

#include "flight/exec/assign.h"
#include "targets/micropython/units.h"
#include "targets/micropython/update.h"

#include <py/runtime.h>

#include <string.h>

enum { ASIDE = 256 /* [bytes] */ };

static AssignField described(const ScriptNode *node, const ScriptField *field)
{
    AssignField all = {.type = (FledgeType)field->type,
                       .size = objects_stride(field, 0),
                       .n_dimensions = field->n_dimensions,
                       .unit = script_field_unit(field)->text};
    for (uint32_t i = 0; i < field->n_dimensions; i++) {
        all.shape[i] = field->shape[i];
    }
    if (field->count != SCRIPT_NO_FIELD) {
        all.count = script_field_name(&node->type->fields[field->count]);
    }
    if (field->type == FLEDGE_STRUCT) {
        all.struct_ = script_field_struct(field)->name;
    }
    return all;
}

// --- refusing --------------------------------------------------------------------------------------

/* "flight.control.K" */
static const mp_print_t *at_field(const ScriptNode *node, const ScriptField *field)
{
    const mp_print_t *error = objects_error();
    objects_print_path(error, node);
    if (node->type->fields) { /* it has none, but a name of its own, in objects_constant */
        mp_printf(error, ".%s", script_field_name(field));
    }
    return error;
}

static void list_names(const mp_print_t *error, const ScriptEnum *values)
{
    for (uint32_t i = 0; i < values->n; i++) {
        mp_printf(error, i ? ", %s" : "%s", values->values[i].name);
    }
}

static const mp_print_t *expected(const ScriptNode *node, const ScriptField *field)
{
    const mp_print_t *error = at_field(node, field);
    const AssignField all = described(node, field);
    const ScriptEnum *names = script_field_enum(field);
    mp_print_str(error, ": expected ");
    if (names == NULL || field->n_dimensions) {
        assign_expected((AssignText){error->data, error->print_strn}, &all);
    }
    if (names != NULL) {
        mp_print_str(error, field->n_dimensions ? " of " : "");
        list_names(error, names);
    }
    mp_print_str(error, "; found ");
    return error;
}

NORETURN static void refuse(const ScriptNode *node, const ScriptField *field, mp_obj_t value)
{
    objects_print_found(expected(node, field), value);
    objects_raise();
}

static void refuse_inert(const ScriptNode *node, const ScriptField *field, mp_obj_t value)
{
    if (objects_is_inert(value)) {
        mp_print_str(at_field(node, field), ": a value of the world or of another process is not known on the target");
        objects_raise();
    }
}

/* The module of a mission writes its outputs; a script that is the module's update may. */
static void refuse_output(const ScriptNode *node, const ScriptField *field)
{
    const ScriptField *outer = field;
    const ScriptNode *n = node;
    for (; n->owner; n = n->owner) {
        outer = objects_field_of(n);
    }
    const ScriptRoot *root = (const ScriptRoot *)n;
    if (root->place >= 0 && update_running() != NULL && update_running() != root) {
        mp_print_str(at_field(node, field), " is of another module: an update writes its own alone");
        objects_raise();
    }
    if (outer->group == SCRIPT_OUT && root->place >= 0 && root->update == MP_OBJ_NULL) {
        mp_print_str(at_field(node, field), " is in an output, which its module writes at each update; assign to a "
                                            "parameter, or to an input that is not wired");
        objects_raise();
    }
}

// --- numbers ---------------------------------------------------------------------------------------

/* Whether the number fits. */
static int write_number(const ScriptField *field, uint8_t *to, mp_obj_t value)
{
    if (mp_obj_is_int(value) || mp_obj_is_bool(value)) {
        const int64_t x = mp_obj_is_int(value) ? mp_obj_int_get_checked(value) : value == mp_const_true;
        return assign_number((FledgeType)field->type, to, assign_whole(x));
    }
    return mp_obj_is_float(value) && assign_number((FledgeType)field->type, to, assign_real(mp_obj_float_get(value)));
}

/* The enumerator of a name, short or whole, or of a number; whether there is one. */
static int enumerator(const ScriptEnum *values, mp_obj_t value, int32_t *number)
{
    if (mp_obj_is_int(value)) {
        const mp_int_t x = mp_obj_int_get_checked(value);
        for (uint32_t i = 0; i < values->n; i++) {
            if (values->values[i].value == x) {
                *number = (int32_t)x;
                return 1;
            }
        }
        return 0;
    }
    if (!mp_obj_is_str(value)) {
        return 0;
    }
    const char *text = mp_obj_str_get_str(value);
    const size_t length = strlen(text), prefix = strlen(values->name);
    uint32_t endings = 0;
    for (uint32_t i = 0; i < values->n; i++) {
        const char *name = values->values[i].name;
        size_t k = 0;
        while (k < prefix && unichar_toupper((unichar)values->name[k]) == (unichar)name[k]) {
            k++;
        }
        if (!strcmp(name, text) || (k == prefix && name[k] == '_' && !strcmp(name + k + 1, text))) {
            *number = values->values[i].value;
            return 1;
        }
        const size_t n = strlen(name);
        if (n > length && name[n - length - 1] == '_' && !strcmp(name + n - length, text)) {
            *number = values->values[i].value;
            endings++;
        }
    }
    return endings == 1;
}

static void enum_attribute(mp_obj_t object, qstr name, mp_obj_t *dest)
{
    const ScriptEnum *values = MP_OBJ_TO_PTR(object);
    int32_t number = 0;
    if (dest[0] != MP_OBJ_NULL) {
        return;
    }
    if (!enumerator(values, MP_OBJ_NEW_QSTR(name), &number)) {
        const mp_print_t *error = objects_error();
        mp_printf(error, "%s has no '%q'; it has ", values->name, name);
        list_names(error, values);
        objects_raise_as(&mp_type_AttributeError);
    }
    dest[0] = mp_obj_new_int(number);
}

MP_DEFINE_CONST_OBJ_TYPE(script_enum_type, MP_QSTR_Enum, MP_TYPE_FLAG_NONE, attr, enum_attribute);

/* What is within a quantity, whose dimensions must be the field's; a field in [SI] takes any. seconds: set to 1 if a
 * time must become one of nanoseconds. */
static mp_obj_t within(const ScriptNode *node, const ScriptField *field, mp_obj_t value, int *seconds)
{
    const ScriptQuantity *q = units_quantity(value);
    if (!q || field->type == FLEDGE_ENUM) {
        return value;
    }
    const char *unit = script_field_unit(field)->text;
    if (!units_alike(q->dims, script_field_unit(field)->dims) && strcmp(unit, "SI") != 0) {
        const mp_print_t *error = at_field(node, field);
        const int plain = !strcmp(unit, "-");
        mp_printf(error, ": expected a %s%s; found ", plain ? "number without unit" : "quantity in ",
                  plain ? "" : unit);
        objects_print_found(error, value);
        objects_raise();
    }
    *seconds |= !strcmp(unit, "ns");
    return within(node, field, q->value, seconds);
}

/* The number of a value that is no list. depth: of the lists around it. */
static void convert(const ScriptNode *node, const ScriptField *field, mp_obj_t value, uint32_t depth, uint8_t *to)
{
    int seconds = 0, fits;
    refuse_inert(node, field, value);
    const mp_obj_t number = within(node, field, value, &seconds);
    if (field->type == FLEDGE_ENUM && (!field->n_dimensions || depth || !mp_obj_is_int(value))) {
        int32_t number;
        fits = enumerator(script_field_enum(field), value, &number) &&
               assign_number(FLEDGE_ENUM, to, assign_whole(number));
    } else if (seconds) {
        int64_t ns;
        fits =
            !units_time(number, &ns, objects_error()) && assign_number((FledgeType)field->type, to, assign_whole(ns));
    } else {
        const int bool_fits = depth || (!field->n_dimensions && !assign_is_float((FledgeType)field->type));
        fits = (bool_fits || !mp_obj_is_bool(number)) && write_number(field, to, number);
    }
    if (!fits) {
        refuse(node, field, value);
    }
}

/* Numbers of a value, first to find their shape, then to write them. */
typedef struct Gathering {
    const ScriptNode *node;
    const ScriptField *field;
    mp_obj_t value;
    uint8_t *to;   ///< NULL: find the shape
    uint32_t step; ///< [elements] from one number to the next
    uint32_t n;
    uint32_t depth;
    size_t shape[ASSIGN_DIMENSIONS];
} Gathering;

static void gather(Gathering *g, mp_obj_t value, uint32_t depth)
{
    size_t n;
    mp_obj_t *items = NULL;
    int seconds = 0;
    refuse_inert(g->node, g->field, value);
    const mp_obj_t plain = within(g->node, g->field, value, &seconds);
    const int is_array = mp_obj_is_type(plain, &script_array_type);
    if (!is_array && !mp_obj_is_type(plain, &mp_type_list) && !mp_obj_is_type(plain, &mp_type_tuple)) {
        if (depth != g->depth) {
            refuse(g->node, g->field, g->value);
        }
        if (g->to) {
            convert(g->node, g->field, value, depth,
                    g->to + (size_t)g->n * g->step * element_size((FledgeType)g->field->type));
        }
        g->n++;
        return;
    }
    if (is_array) {
        n = (size_t)MP_OBJ_SMALL_INT_VALUE(mp_obj_len(plain));
    } else {
        mp_obj_get_array(plain, &n, &items);
    }
    if (depth == ASSIGN_DIMENSIONS || seconds) {
        refuse(g->node, g->field, g->value);
    }
    if (!g->n && depth == g->depth) {
        g->shape[g->depth++] = n;
    } else if (depth >= g->depth || g->shape[depth] != n) {
        refuse(g->node, g->field, g->value);
    }
    for (size_t i = 0; i < n; i++) {
        mp_obj_t item = items ? items[i] : mp_obj_subscr(plain, MP_OBJ_NEW_SMALL_INT(i), MP_OBJ_SENTINEL);
        gather(g, item, depth + 1);
    }
}

// --- rules -----------------------------------------------------------------------------------------

/* The rules of a type's parameters, and where these begin. */
static const CommandBlock *rules_of(const ScriptType *type, uint32_t *start)
{
    for (uint32_t i = 0; i < fledge_script.n_places; i++) {
        const ScriptPlace *place = &fledge_script.places[i];
        if (place->type == type && place->block >= 0) {
            *start = place->parameters;
            return &fledge_script.commands->blocks[place->block];
        }
    }
    return NULL;
}

static void print_broken(const ScriptNode *node, const CommandRule *rule, uint32_t element, const uint8_t *block)
{
    const mp_print_t *error = objects_error();
    objects_print_path(error, node);
    const double x = element_read(rule->number, block + rule->offset + (size_t)element * element_size(rule->number));
    mp_printf(error, ".%s must be %s, found ", rule->name, rule->text);
    mp_obj_print_helper(error, mp_obj_new_float(x), PRINT_REPR);
    if (rule->n > 1u) {
        mp_printf(error, " at [%d]", (int)element);
    }
}

/* Whether a parameter keeps its rules. field: NULL: all parameters. If not, the text of the error is there. */
static int keeps_rules(const ScriptNode *node, const ScriptField *field)
{
    uint32_t start = 0u, element;
    if (!objects_is_module(node) || (field && field->group != SCRIPT_PAR)) {
        return 1;
    }
    const CommandBlock *block = rules_of(node->type, &start);
    const uint8_t *parameters = objects_memory(node) + start;
    for (uint32_t i = 0; block && i < block->n_rules; i++) {
        const CommandRule *rule = &block->rules[i];
        const uint32_t at = rule->offset + start;
        if ((!field || (at >= field->offset && at < field->offset + objects_stride(field, 0))) &&
            command_check(rule, 1, parameters, &element)) {
            print_broken(node, rule, element, parameters);
            return 0;
        }
    }
    return 1;
}

static int given(const ScriptNode *node, uint32_t index)
{
    return objects_is_module(node) && ((const ScriptRoot *)node)->given[index / 8u] >> index % 8u & 1;
}

void objects_check(const ScriptRoot *module)
{
    const ScriptType *type = module->node.type;
    for (uint32_t i = 0; i < type->n; i++) {
        const ScriptField *field = &type->fields[i];
        int zero = 1;
        for (uint32_t k = 0; k < objects_stride(field, 0); k++) {
            zero &= !module->memory[field->offset + k];
        }
        if (field->group == SCRIPT_PAR && field->flags & SCRIPT_REQUIRED && zero && !given(&module->node, i)) {
            mp_print_str(at_field(&module->node, field), " is required");
            objects_raise();
        }
    }
    if (!keeps_rules(&module->node, NULL)) {
        objects_raise();
    }
}

// --- storing ---------------------------------------------------------------------------------------

static void swap(uint8_t *a, uint8_t *b, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const uint8_t kept = a[i];
        a[i] = b[i];
        b[i] = kept;
    }
}

static uint32_t count_of(const ScriptNode *node, const ScriptField *field)
{
    const ScriptField *count = &node->type->fields[field->count];
    return (uint32_t)element_read((FledgeType)count->type, objects_memory(node) + count->offset);
}

static void set_count(const ScriptNode *node, const ScriptField *field, uint32_t n)
{
    const ScriptField *count = &node->type->fields[field->count];
    element_write((FledgeType)count->type, objects_memory(node) + count->offset, n);
}

/* Set the array's count to the number of rows, unless the script or another array has set it. */
static void settle_count(const ScriptNode *node, const ScriptField *field, uint32_t rows)
{
    const ScriptType *type = node->type;
    const char *count = script_field_name(&type->fields[field->count]);
    const uint32_t n = count_of(node, field);
    if (n == rows) {
        return;
    }
    const char *holder = n && given(node, field->count) ? "as given" : NULL;
    for (uint32_t i = 0; i < type->n && n && !holder; i++) {
        const ScriptField *other = &type->fields[i];
        if (other->count == field->count && other != field && (given(node, i) || !objects_is_module(node))) {
            holder = script_field_name(other);
        }
    }
    if (holder) {
        mp_printf(at_field(node, field), ": expected %d rows, for %s is %d, %s; found %d. Set %s first to change it",
                  (int)n, count, (int)n, holder, (int)rows, count);
        objects_raise();
    }
    set_count(node, field, rows);
    if (!keeps_rules(node, &type->fields[field->count])) {
        set_count(node, field, n);
        objects_raise();
    }
}

/* Put bytes that were made aside in place. rows: those that are given of a field with a count, else 0. */
static void put(const ScriptNode *node, const ScriptField *field, uint8_t *aside, uint32_t rows)
{
    uint8_t *to = objects_memory(node) + field->offset;
    const uint32_t size = objects_stride(field, 0);
    const int counts = rows && field->count != SCRIPT_NO_FIELD;
    const uint32_t n = counts ? count_of(node, field) : 0u;
    if (counts) {
        settle_count(node, field, rows);
    }
    swap(to, aside, size);
    if (!keeps_rules(node, field)) {
        swap(to, aside, size);
        if (counts) {
            set_count(node, field, n);
        }
        objects_raise();
    }
}

/* Numbers into zeroed bytes aside, by the shape in which they are given. Returns the rows of a field with a count, 1 of
 * others, or 0 if a number shall fill the rows that count, and there are none. */
static uint32_t spread(const ScriptNode *node, const ScriptField *field, mp_obj_t value, uint8_t *aside)
{
    Gathering g = {.node = node, .field = field, .value = value};
    gather(&g, value, 0);
    const AssignField all = described(node, field);
    AssignSpread how;
    const AssignFit fit = assign_spread(&all, g.shape, g.depth, objects_rows(node, field), &how);
    if (fit == ASSIGN_WRONG_SHAPE) {
        refuse(node, field, value);
    }
    if (fit == ASSIGN_NO_ROWS) {
        return 0;
    }
    const uint32_t width = element_size((FledgeType)field->type);
    memset(aside, 0, all.size);
    g.to = aside;
    g.step = how.step;
    g.n = 0;
    gather(&g, value, 0);
    for (uint32_t i = 1; i < how.copies; i++) {
        memcpy(aside + (size_t)i * how.step * width, aside, width);
    }
    return how.rows;
}

static int store_text(const ScriptNode *node, const ScriptField *field, mp_obj_t value, uint8_t *aside)
{
    size_t n = 0;
    const char *text = mp_obj_is_str(value) ? mp_obj_str_get_data(value, &n) : NULL;
    const uint32_t size = objects_stride(field, 0);
    refuse_inert(node, field, value);
    if (!text || n >= size) {
        refuse(node, field, value);
    }
    memset(aside, 0, size);
    memcpy(aside, text, n);
    return 1;
}

/* A row of `to`, from a struct of the same type or from a dict: fields that it leaves out become 0. */
static void store_row(const ScriptNode *node, const ScriptField *field, mp_obj_t value, uint8_t *to)
{
    static const qstr apart[3] = {MP_QSTRnull, MP_QSTRnull, MP_QSTRnull};
    const ScriptNode *same = objects_struct(value);
    refuse_inert(node, field, value);
    if (same && same->type == script_field_struct(field)) {
        memcpy(to, objects_memory(same), script_field_struct(field)->size);
        return;
    }
    if (!mp_obj_is_type(value, &mp_type_dict)) {
        refuse(node, field, value);
    }
    ScriptRoot row = {
        .node = {.base = {&script_view_type}, .type = script_field_struct(field)}, .memory = to, .place = -1};
    const qstr unknown = assign_all(&row.node, mp_obj_dict_get_map(value), apart);
    if (unknown != MP_QSTRnull) {
        const mp_print_t *error = at_field(node, field);
        mp_printf(error, ": %s has no field '%q'; it has ", script_field_struct(field)->name, unknown);
        objects_print_names(error, script_field_struct(field), -1);
        objects_raise();
    }
}

/* A struct, or an array of them, aside, because the values may be views of what is there. Returns its rows. */
static uint32_t store_structs(const ScriptNode *node, const ScriptField *field, mp_obj_t value, uint8_t *aside)
{
    size_t n = 1;
    mp_obj_t *items = &value;
    const int list = mp_obj_is_type(value, &mp_type_list) || mp_obj_is_type(value, &mp_type_tuple) ||
                     mp_obj_is_type(value, &script_array_type);
    if (list) {
        mp_obj_get_array(objects_plain(value), &n, &items);
    }
    if (field->n_dimensions > 1 || list != (field->n_dimensions == 1) ||
        (list && (field->count == SCRIPT_NO_FIELD ? n != field->shape[0] : n > field->shape[0]))) {
        refuse(node, field, value);
    }
    memset(aside, 0, objects_stride(field, 0));
    for (size_t i = 0; i < n; i++) {
        store_row(node, field, items[i], aside + i * script_field_struct(field)->size);
    }
    return (uint32_t)n;
}

/* Convert, check and write. 0: a number for an array whose count is still 0. */
static int store(ScriptNode *node, const ScriptField *field, mp_obj_t value)
{
    uint8_t small[ASIDE];
    const uint32_t size = objects_stride(field, 0), index = (uint32_t)(field - node->type->fields);
    uint8_t *aside = size <= sizeof small ? small : m_new(uint8_t, size);
    uint32_t rows = 0;
    int stored = 1;
    if (field->type == FLEDGE_STRUCT) {
        rows = store_structs(node, field, value, aside);
        if (!rows && field->count != SCRIPT_NO_FIELD) {
            settle_count(node, field, 0);
        }
    } else if (field->type == FLEDGE_CHAR) {
        stored = store_text(node, field, value, aside);
    } else if (field->n_dimensions) {
        rows = spread(node, field, value, aside);
        stored = rows > 0;
    } else {
        convert(node, field, value, 0, aside);
    }
    if (stored) {
        put(node, field, aside, rows);
        if (field->group == SCRIPT_PAR && objects_is_module(node)) {
            ((ScriptRoot *)node)->given[index / 8u] |= (uint8_t)(1u << index % 8u);
        }
    }
    if (aside != small) {
        m_del(uint8_t, aside, size);
    }
    return stored;
}

NORETURN static void refuse_count(const ScriptNode *node, const ScriptField *field)
{
    const mp_print_t *error = at_field(node, field);
    mp_printf(error,
              ": one number fills the rows that count, and there are none yet; set %s, or give an array with "
              "rows",
              script_field_name(&node->type->fields[field->count]));
    objects_raise();
}

void (*objects_changed)(uint16_t place);

static void notify_executive(const ScriptNode *node)
{
    const int16_t place = objects_root(node)->place;
    if (objects_changed != NULL && place >= 0 && update_running() == NULL) {
        objects_changed((uint16_t)place);
    }
}

void objects_store(ScriptNode *node, const ScriptField *field, mp_obj_t value)
{
    refuse_output(node, field);
    if (!store(node, field, value)) {
        refuse_count(node, field);
    }
    notify_executive(node);
}

/* Long texts of a script are no qstrs. */
static const mp_map_elem_t *named(const mp_map_t *values, const char *name)
{
    for (size_t i = 0; i < values->alloc; i++) {
        if (mp_map_slot_is_filled(values, i) && mp_obj_is_str(values->table[i].key) &&
            !strcmp(mp_obj_str_get_str(values->table[i].key), name)) {
            return &values->table[i];
        }
    }
    return NULL;
}

qstr assign_all(ScriptNode *node, mp_map_t *values, const qstr *apart)
{
    const ScriptType *type = node->type;
    size_t assigned = 0;
    int waiting = 0;
    for (int pass = 0; pass < 1 + waiting; pass++) {
        for (uint32_t i = 0; i < type->n; i++) {
            const ScriptField *field = &type->fields[i];
            const mp_map_elem_t *value = named(values, script_field_name(field));
            if (!value || (pass && (field->count == SCRIPT_NO_FIELD || given(node, i)))) {
                continue;
            }
            assigned += !pass;
            if (!store(node, field, value->value)) {
                if (pass) {
                    refuse_count(node, field);
                }
                waiting = 1;
            }
        }
    }
    for (size_t i = 0; i < values->alloc && assigned < values->used; i++) {
        if (mp_map_slot_is_filled(values, i)) {
            const mp_obj_t key = values->table[i].key;
            const qstr name = mp_obj_is_str(key) ? mp_obj_str_get_qstr(key) : MP_QSTR_;
            if (name != apart[0] && name != apart[1] && name != apart[2] && !objects_field(type, qstr_str(name))) {
                return name;
            }
        }
    }
    return MP_QSTRnull;
}

void assign_element(ScriptNode *node, const ScriptField *field, uint32_t at, mp_obj_t value)
{
    uint8_t aside[8];
    const uint32_t width = element_size((FledgeType)field->type);
    uint8_t *to = objects_memory(node) + at;
    refuse_output(node, field);
    convert(node, field, value, 1, aside);
    swap(to, aside, width);
    if (!keeps_rules(node, field)) {
        swap(to, aside, width);
        objects_raise();
    }
    notify_executive(node);
}

mp_obj_t assign_item(mp_obj_t value, uint32_t k, uint32_t n)
{
    const mp_obj_t length = mp_obj_is_str(value) ? MP_OBJ_NULL : mp_obj_len_maybe(value);
    if (length == MP_OBJ_NULL) {
        return value;
    }
    if (length != MP_OBJ_NEW_SMALL_INT(n)) {
        objects_refuse("expected %d items, or one number for all; found %d", (int)n,
                       (int)MP_OBJ_SMALL_INT_VALUE(length));
    }
    return mp_obj_subscr(value, MP_OBJ_NEW_SMALL_INT(k), MP_OBJ_SENTINEL);
}

// --- for the executive -----------------------------------------------------------------------------

static ScriptBytes copied(const ScriptNode *node, uint32_t offset, uint32_t size)
{
    ScriptBytes bytes = {node->offset + offset, size, m_new(uint8_t, size)};
    memcpy(bytes.bytes, objects_memory(node) + offset, size);
    return bytes;
}

int objects_encode(ScriptNode *node, const ScriptField *field, int32_t index, mp_obj_t value, ScriptBytes out[2])
{
    ScriptRoot *root = objects_root(node);
    const uint32_t size = root->node.type->size, element = element_size((FledgeType)field->type);
    uint8_t *kept = m_new(uint8_t, size);
    memcpy(kept, root->memory, size);
    nlr_buf_t nlr;
    int n = 0;
    if (!nlr_push(&nlr)) {
        if (index >= 0) {
            const uint32_t row = field->n_dimensions ? objects_stride(field, 1) / element : 1u;
            if (field->n_dimensions && (uint32_t)index / row >= objects_rows(node, field)) {
                mp_printf(at_field(node, field), ": the array has %d rows; give it its rows first, or set it whole",
                          (int)objects_rows(node, field));
                objects_raise();
            }
            const uint32_t at = field->offset + (uint32_t)index * element;
            convert(node, field, value, 1, objects_memory(node) + at);
            if (!keeps_rules(node, field)) {
                objects_raise();
            }
            out[n++] = copied(node, at, element);
        } else {
            if (!store(node, field, value)) {
                refuse_count(node, field);
            }
            out[n++] = copied(node, field->offset, objects_stride(field, 0));
            if (field->count != SCRIPT_NO_FIELD) {
                const ScriptField *count = &node->type->fields[field->count];
                out[n++] = copied(node, count->offset, objects_stride(count, 0));
            }
        }
        nlr_pop();
    } else {
        n = -1;
    }
    memcpy(root->memory, kept, size);
    m_del(uint8_t, kept, size);
    if (n < 0) {
        nlr_jump(nlr.ret_val);
    }
    return n;
}

double objects_constant(const ScriptField *field, mp_obj_t value, const char *name)
{
    ScriptField named = *field;
    named.n_dimensions = 0;
    named.count = SCRIPT_NO_FIELD;
    const ScriptType type = {.name = name};
    const ScriptRoot root = {.node = {.base = {&script_view_type}, .type = &type}, .place = -1};
    int seconds = 0;
    refuse_inert(&root.node, &named, value);
    if (field->type == FLEDGE_ENUM) {
        int32_t number;
        if (!enumerator(script_field_enum(field), value, &number)) {
            refuse(&root.node, &named, value);
        }
        return number;
    }
    const mp_obj_t number = within(&root.node, &named, value, &seconds);
    mp_float_t x;
    int64_t ns;
    if (seconds ? units_time(number, &ns, objects_error()) != NULL : !units_plain_number(number, &x)) {
        refuse(&root.node, &named, value);
    }
    return seconds ? (double)ns : x;
}

int64_t objects_time(mp_obj_t value, const char *subject)
{
    int64_t ns;
    const mp_print_t *error = objects_error();
    mp_printf(error, "%s: ", subject);
    if (units_time(value, &ns, error)) {
        objects_raise();
    }
    return ns;
}

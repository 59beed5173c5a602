/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/process.h"

#include "targets/micropython/executive.h"
#include "targets/micropython/objects.h"
#include "targets/micropython/script.h"
#include "targets/micropython/update.h"

#include <py/builtin.h>
#include <py/objtuple.h>
#include <py/runtime.h>

#include <string.h>

#define PROCESS fledge_script.process

/* --- texts of errors ------------------------------------------------------------------------------- */

/* A text on the stack. */
typedef struct Text {
    char text[200];
    ScriptText end;
    mp_print_t print;
} Text;

static const mp_print_t *text_begin(Text *text)
{
    text->end = (ScriptText){text->text, sizeof text->text, 0u};
    text->print = script_text(&text->end);
    return &text->print;
}

/* The names of a list of the executive, whose records begin with `next` and `name`. */
typedef struct Named {
    struct Named *next;
    const char *name;
} Named;

static void print_names(const mp_print_t *print, const void *list, const char *none)
{
    const Named *one = list;
    mp_print_str(print, one != NULL ? one->name : none);
    for (one = one != NULL ? one->next : NULL; one != NULL; one = one->next) {
        mp_printf(print, ", %s", one->name);
    }
}

/* "the mode x; the process has a, b" */
NORETURN static void refuse_name(const char *what, const char *does, const char *name, const void *list)
{
    const mp_print_t *print = objects_error();
    mp_printf(print, "%s %s %s; the process has ", what, does, name);
    print_names(print, list, "none");
    objects_raise();
}

static void check_composing(const char *what)
{
    if (executive.composed) {
        objects_refuse("%s.%s: the mission is composed already; only its script does that, when it starts", PROCESS,
                       what);
    }
}

/* --- conditions ------------------------------------------------------------------------------------ */

enum { WHOLE = 0xFF }; /* a Watch of a whole field, or of a message */

typedef struct Watch {
    mp_obj_base_t base;
    ScriptNode *node;
    const ScriptField *field; ///< NULL: the node itself
    uint32_t index;           ///< of EXEC_ELEMENT
    uint8_t measure;          ///< ExecMeasure, or WHOLE
} Watch;

typedef struct Condition {
    mp_obj_base_t base;
    ExecutiveCondition condition;
} Condition;

static const mp_obj_type_t watch_type, condition_type;

static mp_obj_t new_watch(ScriptNode *node, const ScriptField *field)
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

static const char *watch_text(Text *text, const Watch *w)
{
    watch_print(text_begin(text), MP_OBJ_FROM_PTR(w), PRINT_REPR);
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
        dest[0] = message ? new_watch(objects_view(w->node, field, 0), NULL) : new_watch(w->node, field);
    } else if (w->field->type == FLEDGE_STRUCT) {
        objects_refuse("%s is an array of %s; pick one, as in [0]", watch_text(&text, w),
                       script_field_struct(w->field)->name);
    } else {
        objects_refuse("%s is a number or array; it has norm(), max_abs() and [index]", watch_text(&text, w));
    }
}

static Watch *reduced(mp_obj_t self, ExecMeasure measure, const char *what)
{
    const Watch *w = MP_OBJ_TO_PTR(self);
    if (w->field == NULL || w->field->n_dimensions == 0u || w->measure != WHOLE) {
        Text text;
        objects_refuse("%s: %s is for arrays", watch_text(&text, w), what);
    }
    Watch *other = MP_OBJ_TO_PTR(new_watch(w->node, w->field));
    other->measure = (uint8_t)measure;
    return other;
}

static mp_obj_t watch_norm(mp_obj_t self)
{
    return MP_OBJ_FROM_PTR(reduced(self, EXEC_NORM, "norm()"));
}
static MP_DEFINE_CONST_FUN_OBJ_1(watch_norm_obj, watch_norm);

static mp_obj_t watch_max_abs(mp_obj_t self)
{
    return MP_OBJ_FROM_PTR(reduced(self, EXEC_MAX_ABS, "max_abs()"));
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
    Watch *other = rows ? NULL : reduced(self, EXEC_ELEMENT, "[...]");
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
        return new_watch(objects_view(w->node, w->field, (uint16_t)flat), NULL);
    }
    other->index = (uint32_t)flat;
    return MP_OBJ_FROM_PTR(other);
}

/* Refuse what is no number. verb: what it shall do with one. */
static void check_number(const Watch *w, const char *verb)
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

/* [bytes] of a field in the mission's memory. */
static uint32_t mission_offset(const ScriptNode *node)
{
    return fledge_script.places[objects_root(node)->place].offset + node->offset;
}

static ExecutiveOperand operand_of(const Watch *w)
{
    check_number(w, "compare");
    if (w->measure == WHOLE && w->field->n_dimensions != 0u) {
        Text text;
        objects_refuse("%s is an array: compare an element, norm() or max_abs()", watch_text(&text, w));
    }
    const uint32_t width = element_size((FledgeType)w->field->type);
    ExecutiveOperand o = {.type = w->field->type, .measure = w->measure == WHOLE ? EXEC_ELEMENT : w->measure};
    o.of.field.offset = mission_offset(w->node) + w->field->offset + w->index * width;
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
    Condition *made = mp_obj_malloc(Condition, &condition_type);
    made->condition = c;
    return MP_OBJ_FROM_PTR(made);
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

static MP_DEFINE_CONST_OBJ_TYPE(watch_type, MP_QSTR_Watch,
                                MP_TYPE_FLAG_EQ_NOT_REFLEXIVE | MP_TYPE_FLAG_EQ_CHECKS_OTHER_TYPE |
                                    MP_TYPE_FLAG_EQ_HAS_NEQ_TEST,
                                print, watch_print, attr, watch_attr, subscr, watch_subscr, binary_op, watch_binary,
                                unary_op, watch_unary, locals_dict, &watch_locals);

static mp_obj_t joined(ExecJoin join, const Condition *a, const Condition *b)
{
    Condition *made = mp_obj_malloc(Condition, &condition_type);
    const unsigned depth =
        b != NULL && b->condition.depth + 1u > a->condition.depth ? b->condition.depth + 1u : a->condition.depth;
    if (depth > EXEC_DEPTH) {
        objects_refuse("a condition nests more than %d deep", EXEC_DEPTH);
    }
    made->condition = (ExecutiveCondition){.join = (uint8_t)join, .depth = (uint8_t)depth};
    made->condition.of.parts[0] = &a->condition;
    made->condition.of.parts[1] = b != NULL ? &b->condition : NULL;
    return MP_OBJ_FROM_PTR(made);
}

static mp_obj_t condition_binary(mp_binary_op_t op, mp_obj_t a, mp_obj_t b)
{
    if (!mp_obj_is_type(b, &condition_type) || (op != MP_BINARY_OP_AND && op != MP_BINARY_OP_OR)) {
        return MP_OBJ_NULL;
    }
    return joined(op == MP_BINARY_OP_AND ? EXEC_BOTH : EXEC_EITHER, MP_OBJ_TO_PTR(a), MP_OBJ_TO_PTR(b));
}

static mp_obj_t condition_unary(mp_unary_op_t op, mp_obj_t self)
{
    if (op == MP_UNARY_OP_BOOL) {
        objects_refuse("a condition is only known when the mission runs; join conditions with &, | and ~, each in "
                       "parentheses, as in (x > 1) & (x < 2)");
    }
    return op == MP_UNARY_OP_INVERT ? joined(EXEC_INVERSE, MP_OBJ_TO_PTR(self), NULL) : MP_OBJ_NULL;
}

static MP_DEFINE_CONST_OBJ_TYPE(condition_type, MP_QSTR_Condition, MP_TYPE_FLAG_NONE, binary_op, condition_binary,
                                unary_op, condition_unary);

/* --- handles --------------------------------------------------------------------------------------- */

typedef struct Handle {
    mp_obj_base_t base;
    mp_obj_t name;
} Handle;

typedef struct TaskHandle {
    Handle handle;
    ExecutiveTask task;
} TaskHandle;

typedef struct ModeHandle {
    Handle handle;
    ExecutiveMode mode;
} ModeHandle;

typedef struct EventHandle {
    Handle handle;
    ExecutiveEvent event;
} EventHandle;

#define HANDLE(Type, member, record) ((Type *)(void *)((char *)(record)-offsetof(Type, member)))

static const mp_obj_type_t task_type, mode_type, event_type;

static const char *kind_of(const mp_obj_type_t *type)
{
    return type == &task_type ? "task" : type == &mode_type ? "mode" : "event";
}

static void handle_print(const mp_print_t *print, mp_obj_t self, mp_print_kind_t kind)
{
    (void)kind;
    mp_printf(print, "<%s %s>", kind_of(mp_obj_get_type(self)),
              mp_obj_str_get_str(((Handle *)MP_OBJ_TO_PTR(self))->name));
}

static void handle_attr(mp_obj_t self, qstr attr, mp_obj_t *dest)
{
    if (dest[0] == MP_OBJ_NULL && attr == MP_QSTR_name) {
        dest[0] = ((Handle *)MP_OBJ_TO_PTR(self))->name;
    } else if (dest[0] == MP_OBJ_NULL) {
        dest[1] = MP_OBJ_SENTINEL;
    }
}

static MP_DEFINE_CONST_OBJ_TYPE(task_type, MP_QSTR_Task, MP_TYPE_FLAG_NONE, attr, handle_attr, print, handle_print);

static mp_obj_t ask(ExecutiveMode *mode)
{
    if (!executive_admits(mode)) {
        objects_refuse("mode %s.%s: its condition does not hold", PROCESS, mode->name);
    }
    executive_ask(mode);
    return mp_const_none;
}

static mp_obj_t mode_enter(mp_obj_t self)
{
    return ask(&((ModeHandle *)MP_OBJ_TO_PTR(self))->mode);
}
static MP_DEFINE_CONST_FUN_OBJ_1(mode_enter_obj, mode_enter);

static const mp_rom_map_elem_t mode_locals_table[] = {{MP_ROM_QSTR(MP_QSTR_enter), MP_ROM_PTR(&mode_enter_obj)}};
static MP_DEFINE_CONST_DICT(mode_locals, mode_locals_table);

static MP_DEFINE_CONST_OBJ_TYPE(mode_type, MP_QSTR_Mode, MP_TYPE_FLAG_NONE, attr, handle_attr, print, handle_print,
                                locals_dict, &mode_locals);

static void event_attr(mp_obj_t self, qstr attr, mp_obj_t *dest)
{
    ExecutiveEvent *event = &((EventHandle *)MP_OBJ_TO_PTR(self))->event;
    if (dest[0] == MP_OBJ_SENTINEL && dest[1] != MP_OBJ_NULL && attr == MP_QSTR_armed) {
        event->state.armed = mp_obj_is_true(dest[1]);
        dest[0] = MP_OBJ_NULL;
    } else if (dest[0] == MP_OBJ_NULL && attr == MP_QSTR_armed) {
        dest[0] = mp_obj_new_bool(event->state.armed == 1);
    } else if (dest[0] == MP_OBJ_NULL && attr == MP_QSTR_fired_at) {
        const int64_t t = event->state.fired_at;
        dest[0] = t < 0 ? mp_const_none : mp_obj_new_float((double)t / 1e9);
    } else {
        handle_attr(self, attr, dest);
    }
}

static MP_DEFINE_CONST_OBJ_TYPE(event_type, MP_QSTR_Event, MP_TYPE_FLAG_NONE, attr, event_attr, print, handle_print);

/* A handle of a type, or a name: the name. */
static const char *name_of(mp_obj_t handle, const mp_obj_type_t *type, const char *what)
{
    if (mp_obj_is_str(handle)) {
        return mp_obj_str_get_str(handle);
    }
    if (!mp_obj_is_type(handle, type)) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s takes %ss by handle or name; found ", what, kind_of(type));
        objects_print_found(print, handle);
        objects_raise();
    }
    return mp_obj_str_get_str(((Handle *)MP_OBJ_TO_PTR(handle))->name);
}

/* One of several, or what stands alone; None: nothing. */
static void several(const mp_obj_t *value, size_t *n, const mp_obj_t **items)
{
    mp_obj_t *array;
    if (mp_obj_is_type(*value, &mp_type_tuple) || mp_obj_is_type(*value, &mp_type_list)) {
        mp_obj_get_array(*value, n, &array);
        *items = array;
    } else {
        *n = *value == mp_const_none ? 0u : 1u;
        *items = value;
    }
}

/* --- the process ----------------------------------------------------------------------------------- */

static const mp_obj_type_t process_type;

static struct {
    mp_obj_base_t base;
    mp_obj_t *instances; ///< by place
} process;

mp_obj_t process_object(void)
{
    return MP_OBJ_FROM_PTR(&process);
}

mp_obj_t process_instance(uint16_t place)
{
    return process.instances[place];
}

static mp_obj_t handle_of(const char *name)
{
    ExecutiveMode *mode = executive_find_mode(name);
    ExecutiveEvent *event = executive_find_event(name);
    return mode != NULL    ? MP_OBJ_FROM_PTR(HANDLE(ModeHandle, mode, mode))
           : event != NULL ? MP_OBJ_FROM_PTR(HANDLE(EventHandle, event, event))
                           : MP_OBJ_NULL;
}

/* The place of a name; -1: none. */
static int place_of(const char *name)
{
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        if (strcmp(fledge_script.places[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

static const mp_obj_dict_t process_locals;

static int is_own(qstr attr)
{
    return attr == MP_QSTR_name || attr == MP_QSTR_active_mode ||
           mp_map_lookup((mp_map_t *)&process_locals.map, MP_OBJ_NEW_QSTR(attr), MP_MAP_LOOKUP) != NULL;
}

static void process_store(qstr attr, mp_obj_t value)
{
    const char *name = qstr_str(attr);
    const int place = place_of(name);
    check_composing(name);
    if (is_own(attr)) {
        objects_refuse("%s.%s: this name is taken by the process itself; choose another", PROCESS, name);
    }
    if (handle_of(name) != MP_OBJ_NULL) {
        objects_refuse("%s.%s is already a mode or an event", PROCESS, name);
    }
    if (objects_module(value) == NULL) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s.%s: expected a module; found ", PROCESS, name);
        objects_print_found(print, value);
        objects_raise();
    }
    if (place < 0) {
        objects_refuse("%s.%s: the exported mission has no module of this name; export it again", PROCESS, name);
    }
    if (process.instances[place] != MP_OBJ_NULL) {
        objects_refuse("%s.%s is already there", PROCESS, name);
    }
    objects_place(value, (uint16_t)place);
    process.instances[place] = value;
    executive_name((uint16_t)place);
    if (objects_module(value)->update != MP_OBJ_NULL) {
        update_install(objects_module(value));
    }
}

static void process_attr(mp_obj_t self, qstr attr, mp_obj_t *dest)
{
    (void)self;
    const char *name = qstr_str(attr);
    if (dest[0] == MP_OBJ_SENTINEL) {
        if (dest[1] == MP_OBJ_NULL) {
            return; /* del */
        }
        process_store(attr, dest[1]);
        dest[0] = MP_OBJ_NULL;
        return;
    }
    if (is_own(attr)) {
        if (attr == MP_QSTR_name) {
            dest[0] = MP_OBJ_NEW_QSTR(qstr_from_str(PROCESS));
        } else if (attr == MP_QSTR_active_mode) {
            ExecutiveMode *mode = executive.current != NULL ? executive.current : executive.initial;
            dest[0] = mode != NULL ? HANDLE(ModeHandle, mode, mode)->handle.name : MP_OBJ_NEW_QSTR(MP_QSTR_);
        } else {
            dest[1] = MP_OBJ_SENTINEL;
        }
        return;
    }
    const int place = place_of(name);
    dest[0] = place >= 0 ? process.instances[place] : handle_of(name);
    if (dest[0] == MP_OBJ_NULL) {
        ExecutiveTask *task = executive_find_task(name);
        dest[0] = task != NULL ? MP_OBJ_FROM_PTR(HANDLE(TaskHandle, task, task)) : MP_OBJ_NULL;
    }
    if (dest[0] == MP_OBJ_NULL && name[0] != '_') {
        const mp_print_t *print = objects_error();
        const char *between = "";
        mp_printf(print, "the process %s has no '%s'; it has ", PROCESS, name);
        for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
            if (process.instances[i] != MP_OBJ_NULL) {
                mp_printf(print, "%s%s", between, fledge_script.places[i].name);
                between = ", ";
            }
        }
        mp_print_str(print, between[0] != '\0' ? "" : "nothing yet");
        objects_raise();
    }
}

/* A time that must not be negative. */
static int64_t time_of(mp_obj_t value, const char *kind, const char *name, const char *key)
{
    Text text;
    mp_printf(text_begin(&text), "%s %s.%s: %s", kind, PROCESS, name, key);
    const int64_t t = objects_time(value, text.text);
    if (t < 0) {
        objects_refuse("%s must be >= 0", text.text);
    }
    return t;
}

/* A new mode or event must not have a name of another thing. */
static const char *new_name(mp_obj_t given, const char *kind)
{
    const char *name = mp_obj_str_get_str(given);
    const qstr attr = qstr_find_strn(name, strlen(name));
    const int place = place_of(name);
    check_composing(name);
    if ((place >= 0 && process.instances[place] != MP_OBJ_NULL) || handle_of(name) != MP_OBJ_NULL) {
        objects_refuse("%s %s.%s: it is already there", kind, PROCESS, name);
    }
    if (attr != MP_QSTRnull && is_own(attr)) {
        objects_refuse("%s %s.%s: this name is taken by the process itself; choose another", kind, PROCESS, name);
    }
    return name;
}

static void connect_one(const ScriptNode *target, const ScriptWire *given, uint32_t k)
{
    const ScriptNode *source = given->source->of[k].output;
    Text from, to;
    objects_print_path(text_begin(&from), source);
    objects_print_path(text_begin(&to), target);
    if (objects_root(source)->place < 0 || objects_root(target)->place < 0) {
        objects_refuse("%s >> %s: give both modules their names first, as in f.name = ...", from.text, to.text);
    }
    if (given->latency != 0) {
        objects_refuse("%s >> %s: a latency is for wires between processes", from.text, to.text);
    }
    ExecutiveWire *wire = m_new0(ExecutiveWire, 1);
    wire->from = mission_offset(source);
    wire->to = mission_offset(target);
    wire->size = target->type->size;
    wire->stale_after = given->stale_after;
    wire->mode = given->source->of[k].mode;
    wire->by = (uint8_t)given->source->by;
    wire->before = (uint8_t)k;
    int taken = 0;
    for (const ExecutiveWire *one = executive.wires; one != NULL; one = one->next) {
        taken |= k == 0u && one->to == wire->to;
    }
    for (uint16_t i = 0u; i < fledge_script.n_inputs; i++) {
        taken |= fledge_script.inputs[i].to == wire->to;
    }
    if (taken) {
        objects_refuse("%s >> %s: the input is wired already", from.text, to.text);
    }
    executive_add_wire(wire);
}

static mp_obj_t process_connect(size_t n, const mp_obj_t *args)
{
    check_composing("connect");
    for (size_t i = 1u; i < n; i++) {
        if (objects_is_inert(args[i])) {
            continue;
        }
        if (!mp_obj_is_type(args[i], &script_wire_type)) {
            const mp_print_t *print = objects_error();
            mp_printf(print, "%s.connect: expected wires, as in a.output >> b.input; found ", PROCESS);
            objects_print_found(print, args[i]);
            objects_raise();
        }
        const ScriptWire *wire = MP_OBJ_TO_PTR(args[i]);
        for (uint32_t k = 0u; k < wire->n; k++) {
            for (uint32_t i = 0u; i < wire->source->n; i++) {
                connect_one(wire->targets[k], wire, i);
            }
        }
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_VAR(process_connect_obj, 1, process_connect);

static mp_obj_t process_task(size_t n, const mp_obj_t *args, mp_map_t *keywords)
{
    enum { NAME, EVERY, RUN, OFFSET, PRIORITY };
    static const mp_arg_t allowed[] = {
        {MP_QSTR_name, MP_ARG_REQUIRED | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_every, MP_ARG_REQUIRED | MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_run, MP_ARG_REQUIRED | MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_offset, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_INT(0)}},
        {MP_QSTR_priority, MP_ARG_KW_ONLY | MP_ARG_INT, {.u_int = 0}},
    };
    mp_arg_val_t given[MP_ARRAY_SIZE(allowed)];
    mp_arg_parse_all(n - 1u, args + 1, keywords, MP_ARRAY_SIZE(allowed), allowed, given);
    const char *name = mp_obj_str_get_str(given[NAME].u_obj);
    check_composing(name);
    size_t n_run;
    mp_obj_t *run;
    mp_obj_get_array(given[RUN].u_obj, &n_run, &run);
    uint16_t *places = m_new(uint16_t, n_run);
    for (size_t i = 0u; i < n_run; i++) {
        const ScriptRoot *module = objects_module(run[i]);
        if (module == NULL || module->place < 0) {
            const mp_print_t *print = objects_error();
            mp_printf(print, "task %s.%s: run takes modules of the process; found ", PROCESS, name);
            objects_print_found(print, run[i]);
            objects_raise();
        }
        int taken = executive.modules[module->place].scheduled;
        for (size_t k = 0u; k < i; k++) {
            taken |= places[k] == (uint16_t)module->place;
        }
        if (taken) {
            objects_refuse("task %s.%s runs %s.%s, which is already in a task", PROCESS, name, PROCESS,
                           fledge_script.places[module->place].name);
        }
        places[i] = (uint16_t)module->place;
    }
    if (n_run == 0u || executive_find_task(name) != NULL) {
        objects_refuse("task %s.%s %s", PROCESS, name, n_run == 0u ? "runs nothing" : "is already there");
    }
    TaskHandle *handle = mp_obj_malloc(TaskHandle, &task_type);
    handle->handle.name = given[NAME].u_obj;
    handle->task = (ExecutiveTask){.name = name, .n = (uint16_t)n_run, .run = places};
    handle->task.rate.period = time_of(given[EVERY].u_obj, "task", name, "every");
    handle->task.rate.offset = time_of(given[OFFSET].u_obj, "task", name, "offset");
    handle->task.priority = (int32_t)given[PRIORITY].u_int;
    if (handle->task.rate.period == 0) {
        objects_refuse("task %s.%s: every must be > 0", PROCESS, name);
    }
    executive_add_task(&handle->task);
    return MP_OBJ_FROM_PTR(handle);
}
static MP_DEFINE_CONST_FUN_OBJ_KW(process_task_obj, 1, process_task);

static const ExecutiveCondition *condition_of(mp_obj_t value, const char *what, const char *key)
{
    if (!mp_obj_is_type(value, &condition_type)) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s: %s takes a condition, as in watch(port).field < 1; found ", what, key);
        objects_print_found(print, value);
        objects_raise();
    }
    return &((Condition *)MP_OBJ_TO_PTR(value))->condition;
}

static mp_obj_t process_mode(size_t n_arguments, const mp_obj_t *args, mp_map_t *keywords)
{
    static const mp_arg_t allowed[] = {
        {MP_QSTR_name, MP_ARG_REQUIRED | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_tasks, MP_ARG_REQUIRED | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_when, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
        {MP_QSTR_after, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
    };
    mp_arg_val_t given[MP_ARRAY_SIZE(allowed)];
    mp_arg_parse_all(n_arguments - 1u, args + 1, keywords, MP_ARRAY_SIZE(allowed), allowed, given);
    const char *name = new_name(given[0].u_obj, "mode");
    size_t n, n_after;
    mp_obj_t *items;
    const mp_obj_t *after;
    mp_obj_get_array(given[1].u_obj, &n, &items);
    ModeHandle *handle = mp_obj_malloc(ModeHandle, &mode_type);
    handle->handle.name = given[0].u_obj;
    handle->mode = (ExecutiveMode){.name = name, .n = (uint16_t)n};
    handle->mode.tasks = m_new(ExecutiveTask *, n);
    Text what;
    mp_printf(text_begin(&what), "mode %s.%s", PROCESS, name);
    for (size_t i = 0u; i < n; i++) {
        const char *task = name_of(items[i], &task_type, what.text);
        handle->mode.tasks[i] = executive_find_task(task);
        if (handle->mode.tasks[i] == NULL) {
            refuse_name(what.text, "names the task", task, executive.tasks);
        }
    }
    if (given[2].u_obj != mp_const_none) {
        handle->mode.when = condition_of(given[2].u_obj, what.text, "when");
    }
    several(&given[3].u_obj, &n_after, &after);
    handle->mode.n_after = (uint16_t)n_after;
    handle->mode.after = m_new(const char *, n_after);
    for (size_t i = 0u; i < n_after; i++) {
        handle->mode.after[i] = name_of(after[i], &mode_type, what.text);
    }
    executive_add_mode(&handle->mode);
    return MP_OBJ_FROM_PTR(handle);
}
static MP_DEFINE_CONST_FUN_OBJ_KW(process_mode_obj, 1, process_mode);

static ExecutiveMode *mode_of(mp_obj_t given, const char *what, const char *does)
{
    const char *name = name_of(given, &mode_type, what);
    ExecutiveMode *mode = executive_find_mode(name);
    if (mode == NULL) {
        refuse_name(what, does, name, executive.modes);
    }
    return mode;
}

static mp_obj_t process_start_in(mp_obj_t self, mp_obj_t mode)
{
    (void)self;
    check_composing("start_in");
    executive.initial = mode_of(mode, "start_in:", "there is no mode");
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_2(process_start_in_obj, process_start_in);

static mp_obj_t process_enter(mp_obj_t self, mp_obj_t mode)
{
    (void)self;
    return ask(mode_of(mode, "enter:", "there is no mode"));
}
static MP_DEFINE_CONST_FUN_OBJ_2(process_enter_obj, process_enter);

static mp_obj_t process_watch(mp_obj_t port)
{
    ScriptNode *node = objects_struct(port);
    if (node == NULL) {
        const mp_print_t *print = objects_error();
        mp_print_str(print, "watch: expected a port or module; found ");
        objects_print_found(print, port);
        objects_raise();
    }
    return new_watch(node, NULL);
}
static MP_DEFINE_CONST_FUN_OBJ_1(process_watch_obj, process_watch);
static MP_DEFINE_CONST_STATICMETHOD_OBJ(process_watch_static, MP_ROM_PTR(&process_watch_obj));

/* Link the events that it arms or disarms, at the end. */
static void add_arms(ExecutiveEvent *event, const mp_obj_t *given, uint8_t on, const char *what)
{
    size_t n;
    const mp_obj_t *items;
    ExecutiveArm **end = &event->arms;
    while (*end != NULL) {
        end = &(*end)->next;
    }
    several(given, &n, &items);
    for (size_t i = 0u; i < n; i++) {
        *end = m_new0(ExecutiveArm, 1);
        (*end)->name = name_of(items[i], &event_type, what);
        (*end)->on = on;
        end = &(*end)->next;
    }
}

/* Refuse what is no parameter or output, and numbers that are not finite. */
static void check_setting(const Watch *w, const ScriptBytes *bytes)
{
    const ScriptType *type = objects_root(w->node)->node.type;
    const ScriptField *field = type->fields;
    const FledgeType number = (FledgeType)w->field->type;
    Text text;
    for (uint16_t i = 0u; i < type->n && type->fields[i].offset <= bytes->offset; i++) {
        field = &type->fields[i];
    }
    if (field->group != SCRIPT_PAR && field->group != SCRIPT_OUT) {
        objects_refuse("%s: an event sets parameters and outputs", watch_text(&text, w));
    }
    for (uint32_t k = 0u; (number == FLEDGE_F64 || number == FLEDGE_F32) && k < bytes->size;
         k += element_size(number)) {
        const double x = element_read(number, bytes->bytes + k);
        if (!(x - x == 0.0)) {
            objects_refuse("%s: an event sets numbers that are finite", watch_text(&text, w));
        }
    }
}

static void add_settings(ExecutiveEvent *event, mp_obj_t given, const char *what)
{
    size_t n;
    mp_obj_t *pairs;
    ExecutiveSetting **end = &event->settings;
    mp_obj_get_array(given, &n, &pairs);
    for (size_t i = 0u; i < n; i++) {
        size_t two = 0u;
        mp_obj_t *pair = NULL;
        if (mp_obj_is_type(pairs[i], &mp_type_tuple)) {
            mp_obj_tuple_get(pairs[i], &two, &pair);
        }
        if (two != 2u || !mp_obj_is_type(pair[0], &watch_type)) {
            const mp_print_t *print = objects_error();
            mp_printf(
                print,
                "%s: set takes pairs of a field and a value, as in set=[(f.watch(f.module).parameter, 1)]; found ",
                what);
            objects_print_found(print, pairs[i]);
            objects_raise();
        }
        const Watch *w = MP_OBJ_TO_PTR(pair[0]);
        ScriptBytes bytes[2];
        check_number(w, "set");
        if (w->measure != WHOLE && w->measure != EXEC_ELEMENT) {
            Text text;
            objects_refuse("%s: set an element of it, or the whole field", watch_text(&text, w));
        }
        const int32_t index = w->measure == WHOLE ? -1 : (int32_t)w->index;
        const int n_bytes = objects_encode(w->node, w->field, index, pair[1], bytes);
        check_setting(w, bytes);
        for (int k = 0; k < n_bytes; k++) {
            *end = m_new0(ExecutiveSetting, 1);
            (*end)->offset = fledge_script.places[objects_root(w->node)->place].offset + bytes[k].offset;
            (*end)->n = bytes[k].size;
            (*end)->bytes = bytes[k].bytes;
            end = &(*end)->next;
        }
    }
}

static mp_obj_t process_event(size_t n, const mp_obj_t *args, mp_map_t *keywords)
{
    enum { NAME, WHEN, UNTIL, HOLD, COUNT, ONCE, ARMED, MODES, ENTER, ARM, DISARM, SET, DO };
    static const mp_arg_t allowed[] = {
        {MP_QSTR_name, MP_ARG_REQUIRED | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_when, MP_ARG_REQUIRED | MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_until, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
        {MP_QSTR_hold, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_INT(0)}},
        {MP_QSTR_count, MP_ARG_KW_ONLY | MP_ARG_INT, {.u_int = 1}},
        {MP_QSTR_once, MP_ARG_KW_ONLY | MP_ARG_BOOL, {.u_bool = false}},
        {MP_QSTR_armed, MP_ARG_KW_ONLY | MP_ARG_BOOL, {.u_bool = true}},
        {MP_QSTR_modes, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
        {MP_QSTR_enter, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
        {MP_QSTR_arm, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
        {MP_QSTR_disarm, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
        {MP_QSTR_set, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_PTR(&mp_const_empty_tuple_obj)}},
        {MP_QSTR_do, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}},
    };
    mp_arg_val_t given[MP_ARRAY_SIZE(allowed)];
    mp_arg_parse_all(n - 1u, args + 1, keywords, MP_ARRAY_SIZE(allowed), allowed, given);
    const char *name = new_name(given[NAME].u_obj, "event");
    Text text;
    mp_printf(text_begin(&text), "event %s.%s", PROCESS, name);
    const char *what = text.text;
    if (given[DO].u_obj != mp_const_none) {
        objects_refuse("%s: flight's events are data: a condition made with watch(), and enter, arm, disarm or set; "
                       "Python belongs into the world's events",
                       what);
    }
    EventHandle *handle = mp_obj_malloc(EventHandle, &event_type);
    handle->handle.name = given[NAME].u_obj;
    ExecutiveEvent *event = &handle->event;
    *event = (ExecutiveEvent){.name = name, .once = given[ONCE].u_bool, .armed = given[ARMED].u_bool};
    event->state = event->armed ? exec_armed() : exec_disarmed();
    event->when = condition_of(given[WHEN].u_obj, what, "when");
    if (given[UNTIL].u_obj != mp_const_none) {
        event->until = condition_of(given[UNTIL].u_obj, what, "until");
    }
    event->hold = time_of(given[HOLD].u_obj, "event", name, "hold");
    event->count = (int32_t)given[COUNT].u_int;
    if (given[COUNT].u_int < 1 || given[COUNT].u_int > INT32_MAX) {
        objects_refuse("%s: the count must be >= 1 and below 2^31", what);
    }
    if (event->once && event->until != NULL) {
        objects_refuse("%s: with once, it does not arm itself again: leave out until", what);
    }
    size_t n_modes;
    const mp_obj_t *modes;
    several(&given[MODES].u_obj, &n_modes, &modes);
    event->n_modes = (uint16_t)n_modes;
    event->modes = m_new(ExecutiveMode *, n_modes);
    for (size_t i = 0u; i < n_modes; i++) {
        event->modes[i] = mode_of(modes[i], what, "looks in the mode");
    }
    if (given[ENTER].u_obj != mp_const_none) {
        event->enter = mode_of(given[ENTER].u_obj, what, "enters the mode");
    }
    add_arms(event, &given[ARM].u_obj, 1u, what);
    add_arms(event, &given[DISARM].u_obj, 0u, what);
    add_settings(event, given[SET].u_obj, what);
    if (event->enter == NULL && event->arms == NULL && event->settings == NULL) {
        objects_refuse("%s does nothing: give it a mode to enter or something to do", what);
    }
    executive_add_event(event);
    return MP_OBJ_FROM_PTR(handle);
}
static MP_DEFINE_CONST_FUN_OBJ_KW(process_event_obj, 1, process_event);

static mp_obj_t process_reset_by(size_t n, const mp_obj_t *args, mp_map_t *keywords)
{
    static const mp_arg_t allowed[] = {
        {MP_QSTR_message, MP_ARG_REQUIRED | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_down, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_INT(0)}},
    };
    mp_arg_val_t given[MP_ARRAY_SIZE(allowed)];
    mp_arg_parse_all(n - 1u, args + 1, keywords, MP_ARRAY_SIZE(allowed), allowed, given);
    check_composing("reset_by");
    const ScriptNode *node = objects_struct(given[0].u_obj);
    const ScriptField *field = node != NULL && node->owner != NULL ? objects_field_of(node) : NULL;
    if (field == NULL || field->group != SCRIPT_IN || strcmp(node->type->name, "ComputerReset") != 0 ||
        objects_root(node)->place < 0) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s.reset_by: expected an input of a module of this process, a ComputerReset; found ",
                  PROCESS);
        objects_print_found(print, given[0].u_obj);
        objects_raise();
    }
    executive.reset = mission_offset(node);
    Text text;
    mp_printf(text_begin(&text), "%s.reset_by: down", PROCESS);
    executive.down = objects_time(given[1].u_obj, text.text);
    if (executive.down < 0) {
        objects_refuse("%s must be >= 0", text.text);
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_KW(process_reset_by_obj, 1, process_reset_by);

static const mp_rom_map_elem_t process_locals_table[] = {
    {MP_ROM_QSTR(MP_QSTR_connect), MP_ROM_PTR(&process_connect_obj)},
    {MP_ROM_QSTR(MP_QSTR_task), MP_ROM_PTR(&process_task_obj)},
    {MP_ROM_QSTR(MP_QSTR_mode), MP_ROM_PTR(&process_mode_obj)},
    {MP_ROM_QSTR(MP_QSTR_start_in), MP_ROM_PTR(&process_start_in_obj)},
    {MP_ROM_QSTR(MP_QSTR_enter), MP_ROM_PTR(&process_enter_obj)},
    {MP_ROM_QSTR(MP_QSTR_watch), MP_ROM_PTR(&process_watch_static)},
    {MP_ROM_QSTR(MP_QSTR_event), MP_ROM_PTR(&process_event_obj)},
    {MP_ROM_QSTR(MP_QSTR_reset_by), MP_ROM_PTR(&process_reset_by_obj)},
};
static MP_DEFINE_CONST_DICT(process_locals, process_locals_table);

static void process_print(const mp_print_t *print, mp_obj_t self, mp_print_kind_t kind)
{
    (void)self;
    (void)kind;
    mp_printf(print, "<process %s>", PROCESS);
}

static MP_DEFINE_CONST_OBJ_TYPE(process_type, MP_QSTR_Flight, MP_TYPE_FLAG_NONE, attr, process_attr, print,
                                process_print, locals_dict, &process_locals);

/* --- the simulation, for missions with a mission.py ------------------------------------------------ */

static const mp_obj_type_t simulation_type;
static const mp_obj_base_t simulation = {&simulation_type};

static mp_obj_t simulation_process(mp_obj_t self, mp_obj_t given)
{
    (void)self;
    const char *name = mp_obj_str_get_str(given);
    const char *const *known = fledge_script.processes;
    while (*known != NULL && strcmp(*known, name) != 0) {
        known++;
    }
    if (*known == NULL) {
        objects_refuse("the exported mission has no process '%s'; export it again", name);
    }
    return strcmp(name, PROCESS) == 0 ? process_object() : MP_OBJ_FROM_PTR(&script_inert);
}
static MP_DEFINE_CONST_FUN_OBJ_2(simulation_process_obj, simulation_process);

static void simulation_attr(mp_obj_t self, qstr attr, mp_obj_t *dest)
{
    (void)self;
    if (dest[0] != MP_OBJ_NULL) {
        return;
    }
    if (attr == MP_QSTR_flight) {
        dest[0] = process_object();
    } else if (attr == MP_QSTR_world) {
        dest[0] = MP_OBJ_FROM_PTR(&script_inert);
    } else {
        dest[1] = MP_OBJ_SENTINEL;
    }
}

static const mp_rom_map_elem_t simulation_locals_table[] = {
    {MP_ROM_QSTR(MP_QSTR_add_flight), MP_ROM_PTR(&simulation_process_obj)},
    {MP_ROM_QSTR(MP_QSTR_add_world), MP_ROM_PTR(&simulation_process_obj)},
    {MP_ROM_QSTR(MP_QSTR_process), MP_ROM_PTR(&simulation_process_obj)},
};
static MP_DEFINE_CONST_DICT(simulation_locals, simulation_locals_table);

static MP_DEFINE_CONST_OBJ_TYPE(simulation_type, MP_QSTR_Simulation, MP_TYPE_FLAG_NONE, attr, simulation_attr,
                                locals_dict, &simulation_locals);

/* --- the script ------------------------------------------------------------------------------------ */

static mp_obj_t compose(void *context)
{
    (void)context;
    process.base.type = &process_type;
    process.instances = m_new0(mp_obj_t, fledge_script.n_places);
    /* With names to import from it, the value is the module itself, not its package. */
    const mp_obj_t module = mp_import_name(qstr_from_str(fledge_script.module), mp_const_true, MP_OBJ_NEW_SMALL_INT(0));
    return mp_call_function_1(mp_import_from(module, MP_QSTR_build),
                              fledge_script.whole ? MP_OBJ_FROM_PTR(&simulation) : process_object());
}

const char *process_run(void)
{
    static Arena arena;
    arena_begin(&arena, fledge_script.heap, fledge_script.heap_size);
    script_start(&arena);
    update_begin();
    objects_changed = executive_changed;
    if (!executive_begin()) {
        return "the heap has no room for the table of modules";
    }
    return script_guard(compose, NULL) == MP_OBJ_NULL ? script_error() : NULL;
}

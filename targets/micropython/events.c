/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/composition.h"

/* Link the events that it arms or disarms, at the end. */
static void add_arms(ExecutiveEvent *event, const mp_obj_t *given, uint8_t on, const char *subject)
{
    size_t n;
    const mp_obj_t *items;
    ExecutiveArm **end = &event->arms;
    while (*end != NULL) {
        end = &(*end)->next;
    }
    handle_list(given, &n, &items);
    for (size_t i = 0u; i < n; i++) {
        *end = m_new0(ExecutiveArm, 1);
        (*end)->name = handle_name(items[i], &process_event_type, subject);
        (*end)->on = on;
        end = &(*end)->next;
    }
}

static void add_modes(ExecutiveEvent *event, const mp_obj_t *given, const char *subject)
{
    size_t n_modes;
    const mp_obj_t *modes;
    handle_list(given, &n_modes, &modes);
    event->n_modes = (uint16_t)n_modes;
    event->modes = m_new(ExecutiveMode *, n_modes);
    for (size_t i = 0u; i < n_modes; i++) {
        event->modes[i] = process_find_mode(modes[i], subject, "looks in the mode");
    }
}

/* Refuse all but parameters and outputs, and numbers that are not finite. */
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

static void add_settings(ExecutiveEvent *event, mp_obj_t given, const char *subject)
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
                subject);
            objects_print_found(print, pairs[i]);
            objects_raise();
        }
        const Watch *w = MP_OBJ_TO_PTR(pair[0]);
        ScriptBytes bytes[2];
        watch_check_number(w, "set");
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
    const char *name = process_new_name(given[NAME].u_obj, "event");
    Text text;
    mp_printf(process_text(&text), "event %s.%s", PROCESS, name);
    const char *subject = text.text;
    if (given[DO].u_obj != mp_const_none) {
        objects_refuse("%s: flight's events are data: a condition made with watch(), and enter, arm, disarm or set; "
                       "Python belongs into the world's events",
                       subject);
    }
    EventHandle *handle = mp_obj_malloc(EventHandle, &process_event_type);
    handle->handle.name = given[NAME].u_obj;
    ExecutiveEvent *event = &handle->event;
    *event = (ExecutiveEvent){.name = name, .once = given[ONCE].u_bool, .armed = given[ARMED].u_bool};
    event->state = event->armed ? exec_armed() : exec_disarmed();
    event->when = watch_condition(given[WHEN].u_obj, subject, "when");
    if (given[UNTIL].u_obj != mp_const_none) {
        event->until = watch_condition(given[UNTIL].u_obj, subject, "until");
    }
    event->hold = process_time(given[HOLD].u_obj, "event", name, "hold");
    event->count = (int32_t)given[COUNT].u_int;
    if (given[COUNT].u_int < 1 || given[COUNT].u_int > INT32_MAX) {
        objects_refuse("%s: the count must be >= 1 and below 2^31", subject);
    }
    if (event->once && event->until != NULL) {
        objects_refuse("%s: with once, it does not arm itself again: leave out until", subject);
    }
    add_modes(event, &given[MODES].u_obj, subject);
    if (given[ENTER].u_obj != mp_const_none) {
        event->enter = process_find_mode(given[ENTER].u_obj, subject, "enters the mode");
    }
    add_arms(event, &given[ARM].u_obj, 1u, subject);
    add_arms(event, &given[DISARM].u_obj, 0u, subject);
    add_settings(event, given[SET].u_obj, subject);
    if (event->enter == NULL && event->arms == NULL && event->settings == NULL) {
        objects_refuse("%s does nothing: give it a mode to enter or something to do", subject);
    }
    executive_add_event(event);
    return MP_OBJ_FROM_PTR(handle);
}
MP_DEFINE_CONST_FUN_OBJ_KW(process_event_obj, 1, process_event);

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/composition.h"

static const char *kind_of(const mp_obj_type_t *type)
{
    return type == &process_task_type ? "task" : type == &process_mode_type ? "mode" : "event";
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

MP_DEFINE_CONST_OBJ_TYPE(process_task_type, MP_QSTR_Task, MP_TYPE_FLAG_NONE, attr, handle_attr, print, handle_print);

mp_obj_t handle_enter(ExecutiveMode *mode)
{
    if (!executive_admits(mode)) {
        objects_refuse("mode %s.%s: its condition does not hold", PROCESS, mode->name);
    }
    executive_request(mode);
    return mp_const_none;
}

static mp_obj_t mode_enter(mp_obj_t self)
{
    return handle_enter(&((ModeHandle *)MP_OBJ_TO_PTR(self))->mode);
}
static MP_DEFINE_CONST_FUN_OBJ_1(mode_enter_obj, mode_enter);

static const mp_rom_map_elem_t mode_locals_table[] = {{MP_ROM_QSTR(MP_QSTR_enter), MP_ROM_PTR(&mode_enter_obj)}};
static MP_DEFINE_CONST_DICT(mode_locals, mode_locals_table);

MP_DEFINE_CONST_OBJ_TYPE(process_mode_type, MP_QSTR_Mode, MP_TYPE_FLAG_NONE, attr, handle_attr, print, handle_print,
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

MP_DEFINE_CONST_OBJ_TYPE(process_event_type, MP_QSTR_Event, MP_TYPE_FLAG_NONE, attr, event_attr, print, handle_print);

const char *handle_name(mp_obj_t handle, const mp_obj_type_t *type, const char *subject)
{
    if (mp_obj_is_str(handle)) {
        return mp_obj_str_get_str(handle);
    }
    if (!mp_obj_is_type(handle, type)) {
        const mp_print_t *print = objects_error();
        mp_printf(print, "%s takes %ss by handle or name; found ", subject, kind_of(type));
        objects_print_found(print, handle);
        objects_raise();
    }
    return mp_obj_str_get_str(((Handle *)MP_OBJ_TO_PTR(handle))->name);
}

void handle_list(const mp_obj_t *value, size_t *n, const mp_obj_t **items)
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

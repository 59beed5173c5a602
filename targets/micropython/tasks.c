/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/composition.h"

/* The places of the modules that a task runs. */
static const uint16_t *places_of(mp_obj_t given, size_t *n, const char *name)
{
    mp_obj_t *run;
    mp_obj_get_array(given, n, &run);
    uint16_t *places = m_new(uint16_t, *n);
    for (size_t i = 0u; i < *n; i++) {
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
    return places;
}

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
    process_check_composing(name);
    size_t n_run;
    const uint16_t *places = places_of(given[RUN].u_obj, &n_run, name);
    if (n_run == 0u || executive_find_task(name) != NULL) {
        objects_refuse("task %s.%s %s", PROCESS, name, n_run == 0u ? "runs nothing" : "is already there");
    }
    TaskHandle *handle = mp_obj_malloc(TaskHandle, &process_task_type);
    handle->handle.name = given[NAME].u_obj;
    handle->task = (ExecutiveTask){.name = name, .n = (uint16_t)n_run, .run = places};
    handle->task.rate.period = process_time(given[EVERY].u_obj, "task", name, "every");
    handle->task.rate.offset = process_time(given[OFFSET].u_obj, "task", name, "offset");
    handle->task.priority = (int32_t)given[PRIORITY].u_int;
    if (handle->task.rate.period == 0) {
        objects_refuse("task %s.%s: every must be > 0", PROCESS, name);
    }
    executive_add_task(&handle->task);
    return MP_OBJ_FROM_PTR(handle);
}
MP_DEFINE_CONST_FUN_OBJ_KW(process_task_obj, 1, process_task);

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
    const char *name = process_new_name(given[0].u_obj, "mode");
    size_t n, n_after;
    mp_obj_t *items;
    const mp_obj_t *after;
    mp_obj_get_array(given[1].u_obj, &n, &items);
    ModeHandle *handle = mp_obj_malloc(ModeHandle, &process_mode_type);
    handle->handle.name = given[0].u_obj;
    handle->mode = (ExecutiveMode){.name = name, .n = (uint16_t)n};
    handle->mode.tasks = m_new(ExecutiveTask *, n);
    Text subject;
    mp_printf(process_text(&subject), "mode %s.%s", PROCESS, name);
    for (size_t i = 0u; i < n; i++) {
        const char *task = handle_name(items[i], &process_task_type, subject.text);
        handle->mode.tasks[i] = executive_find_task(task);
        if (handle->mode.tasks[i] == NULL) {
            process_refuse_name(subject.text, "names the task", task, executive.tasks);
        }
    }
    if (given[2].u_obj != mp_const_none) {
        handle->mode.when = watch_condition(given[2].u_obj, subject.text, "when");
    }
    handle_list(&given[3].u_obj, &n_after, &after);
    handle->mode.n_after = (uint16_t)n_after;
    handle->mode.after = m_new(const char *, n_after);
    for (size_t i = 0u; i < n_after; i++) {
        handle->mode.after[i] = handle_name(after[i], &process_mode_type, subject.text);
    }
    executive_add_mode(&handle->mode);
    return MP_OBJ_FROM_PTR(handle);
}
MP_DEFINE_CONST_FUN_OBJ_KW(process_mode_obj, 1, process_mode);

ExecutiveMode *process_find_mode(mp_obj_t given, const char *subject, const char *does)
{
    const char *name = handle_name(given, &process_mode_type, subject);
    ExecutiveMode *mode = executive_find_mode(name);
    if (mode == NULL) {
        process_refuse_name(subject, does, name, executive.modes);
    }
    return mode;
}

static mp_obj_t process_start_in(mp_obj_t self, mp_obj_t mode)
{
    (void)self;
    process_check_composing("start_in");
    executive.initial = process_find_mode(mode, "start_in:", "there is no mode");
    return mp_const_none;
}
MP_DEFINE_CONST_FUN_OBJ_2(process_start_in_obj, process_start_in);

static mp_obj_t process_enter(mp_obj_t self, mp_obj_t mode)
{
    (void)self;
    return handle_enter(process_find_mode(mode, "enter:", "there is no mode"));
}
MP_DEFINE_CONST_FUN_OBJ_2(process_enter_obj, process_enter);

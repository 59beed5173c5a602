/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/process.h"

#include "targets/micropython/composition.h"
#include "targets/micropython/update.h"

#include <py/builtin.h>

#include <string.h>

uint32_t process_offset(const ScriptNode *node)
{
    return fledge_script.places[objects_root(node)->place].offset + node->offset;
}

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
    process_check_composing(name);
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

int64_t process_time(mp_obj_t value, const char *kind, const char *name, const char *key)
{
    Text text;
    mp_printf(process_text(&text), "%s %s.%s: %s", kind, PROCESS, name, key);
    const int64_t t = objects_time(value, text.text);
    if (t < 0) {
        objects_refuse("%s must be >= 0", text.text);
    }
    return t;
}

const char *process_new_name(mp_obj_t given, const char *kind)
{
    const char *name = mp_obj_str_get_str(given);
    const qstr attr = qstr_find_strn(name, strlen(name));
    const int place = place_of(name);
    process_check_composing(name);
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
    objects_print_path(process_text(&from), source);
    objects_print_path(process_text(&to), target);
    if (objects_root(source)->place < 0 || objects_root(target)->place < 0) {
        objects_refuse("%s >> %s: give both modules their names first, as in f.name = ...", from.text, to.text);
    }
    if (given->latency != 0) {
        objects_refuse("%s >> %s: a latency is for wires between processes", from.text, to.text);
    }
    ExecutiveWire *wire = m_new0(ExecutiveWire, 1);
    wire->from = process_offset(source);
    wire->to = process_offset(target);
    wire->size = target->type->size;
    wire->stale_after = given->stale_after;
    wire->mode = given->source->of[k].mode;
    wire->by = (uint8_t)given->source->by;
    wire->before = (uint8_t)k;
    int taken = 0;
    for (const ExecutiveWire *earlier = executive.wires; earlier != NULL; earlier = earlier->next) {
        taken |= k == 0u && earlier->to == wire->to;
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
    process_check_composing("connect");
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

static mp_obj_t process_watch(mp_obj_t port)
{
    ScriptNode *node = objects_struct(port);
    if (node == NULL) {
        const mp_print_t *print = objects_error();
        mp_print_str(print, "watch: expected a port or module; found ");
        objects_print_found(print, port);
        objects_raise();
    }
    return watch_new(node, NULL);
}
static MP_DEFINE_CONST_FUN_OBJ_1(process_watch_obj, process_watch);
static MP_DEFINE_CONST_STATICMETHOD_OBJ(process_watch_static, MP_ROM_PTR(&process_watch_obj));

static mp_obj_t process_reset_by(size_t n, const mp_obj_t *args, mp_map_t *keywords)
{
    static const mp_arg_t allowed[] = {
        {MP_QSTR_message, MP_ARG_REQUIRED | MP_ARG_OBJ, {.u_int = 0}},
        {MP_QSTR_down, MP_ARG_KW_ONLY | MP_ARG_OBJ, {.u_rom_obj = MP_ROM_INT(0)}},
    };
    mp_arg_val_t given[MP_ARRAY_SIZE(allowed)];
    mp_arg_parse_all(n - 1u, args + 1, keywords, MP_ARRAY_SIZE(allowed), allowed, given);
    process_check_composing("reset_by");
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
    executive.reset = process_offset(node);
    Text text;
    mp_printf(process_text(&text), "%s.reset_by: down", PROCESS);
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

/* --- the simulation, for missions with a mission.py */

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

/* --- the script */

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

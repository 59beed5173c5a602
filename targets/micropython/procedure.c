/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/procedure.h"

#include "flight/exec/event.h"
#include "targets/micropython/bytecode.h"
#include "targets/micropython/executive.h"
#include "targets/micropython/objects.h"
#include "targets/micropython/process.h"
#include "targets/micropython/script.h"
#include "targets/micropython/units.h"

#include <py/objgenerator.h>
#include <py/runtime.h>
#include <string.h>

enum {
    SLOTS = 2,
    ROOM = 2048,           /* [bytes] of a slot; PROCEDURE_MAX in python/fledge/commands.py */
    HEAP = 16 * 1024,      /* [bytes] of a procedure */
    TEXT_HEAP = 48 * 1024, /* [bytes] of a text, with its compilation */
    NAMES = 24             /* in the first table of new names */
};

/* --- an interpreter apart -------------------------------------------------------------------------- */

/* A heap, and the state of the interpreter that goes with it. */
typedef struct Apart {
    CommandContext context;
    Arena arena;
    mp_state_vm_t state;
    mp_obj_dict_t *globals;
    ScriptRoot **copies; ///< of modules, by place; NULL: not used yet
    mp_obj_t program;    ///< the generator
    int64_t wake;        ///< [ns] it waits until then
    uint32_t turns;      ///< in one instant
    uint32_t n;          ///< [bytes] of bytecode, before the first turn
    uint16_t slot;
    uint8_t runs;
    uint8_t waits;   ///< 1: wait() was called in this turn
    uint8_t changes; ///< 1: it may change all memory of modules, not only parameters
} Apart;

static Apart procedure;
static Apart *apart; /* whose turn it is; NULL: the script's */
static uint8_t slots[SLOTS][ROOM];

/* The output of a program that is not sent yet. */
static struct {
    char text[COMMAND_DATA_MAX + 1];
    uint32_t n;
} printed;

static void report(const Apart *a, TelemetryTextKind kind, uint32_t line, const char *text)
{
    telemetry_text(&executive_texts, a->context.t, kind, a->context.sequence, line, text);
}

static void flush(TelemetryTextKind kind)
{
    printed.text[printed.n] = '\0';
    report(apart, kind, 0u, printed.text);
    printed.n = 0u;
}

static void print(const char *text, size_t n)
{
    for (size_t i = 0u; i < n; i++) {
        if (apart == &procedure && text[i] == '\n') {
            flush(TELEMETRY_PRINTED);
        } else if (printed.n + 1u < sizeof printed.text) {
            printed.text[printed.n++] = text[i];
        }
    }
}

/* Run a function of C with a program's heap and state of the interpreter, under its budget. MP_OBJ_NULL: it failed. */
static mp_obj_t run_apart(Apart *a, mp_obj_t (*run)(void *))
{
    Arena *const arena = arena_in_use;
    void (*const out)(const char *, size_t) = script_out;
    const mp_state_vm_t state = mp_state_ctx.vm;
    mp_obj_dict_t *const globals = mp_globals_get(), *const locals = mp_locals_get();
    mp_state_ctx.vm = a->state;
    arena_in_use = &a->arena;
    script_out = print;
    apart = a;
    printed.n = 0u;
    script_limit(a->turns);
    const mp_obj_t result = script_guard(run, a);
    script_limit(0u);
    if (a == &procedure && printed.n != 0u) {
        flush(TELEMETRY_PRINTED);
    }
    apart = NULL;
    script_out = out;
    arena_in_use = arena;
    a->state = mp_state_ctx.vm;
    mp_state_ctx.vm = state;
    mp_globals_set(globals);
    mp_locals_set(locals);
    return result;
}

/* Names that a program adds go into tables of its own, and so do the modules that it imports. */
static void begin_names(void)
{
    const size_t entry = sizeof(const char *) + sizeof(qstr_hash_t) + sizeof(qstr_len_t);
    qstr_pool_t *pool = m_malloc0(sizeof *pool + NAMES * entry);
    pool->prev = MP_STATE_VM(last_pool);
    pool->total_prev_len = pool->prev->total_prev_len + pool->prev->len;
    pool->alloc = NAMES;
    pool->hashes = (qstr_hash_t *)(void *)(pool->qstrs + NAMES);
    pool->lengths = (qstr_len_t *)(void *)(pool->hashes + NAMES);
    MP_STATE_VM(last_pool) = pool;
    MP_STATE_VM(qstr_last_chunk) = NULL;
    mp_obj_dict_init(&MP_STATE_VM(mp_loaded_modules_dict), 2);
    mp_obj_dict_init(&MP_STATE_VM(dict_main), 1);
    mp_sys_path = mp_obj_new_list(0, NULL); /* no frozen script: the script's modules are its own */
}

/* --- the view of a program ------------------------------------------------------------------------- */

static const ScriptPlace *place_at(uint16_t i)
{
    return &fledge_script.places[i];
}

static uint8_t *memory_of(const ScriptPlace *place)
{
    return (uint8_t *)fledge_script.memory + place->offset;
}

static mp_obj_t copy_of(uint16_t i)
{
    const ScriptPlace *place = place_at(i);
    if (apart->copies[i] == NULL) {
        ScriptRoot *root = m_malloc0(sizeof *root + place->type->n / 8u);
        root->node.base.type = &script_module_type;
        root->node.type = place->type;
        root->place = (int16_t)i;
        root->update = apart->changes ? mp_const_none : MP_OBJ_NULL; /* its outputs may be written */
        root->memory = m_malloc(place->type->size);
        memcpy(root->memory, memory_of(place), place->type->size);
        memcpy(root->given, objects_module(process_instance(i))->given, 1u + place->type->n / 8u);
        apart->copies[i] = root;
    }
    return MP_OBJ_FROM_PTR(apart->copies[i]);
}

static int index_of(const char *const *names, uint16_t n, const char *name)
{
    for (uint16_t i = 0u; i < n; i++) {
        if (strcmp(names[i], name) == 0) {
            return i;
        }
    }
    return -1;
}

static mp_obj_t flight_enter(mp_obj_t self, mp_obj_t mode)
{
    (void)self;
    const char *name = mp_obj_str_get_str(mode);
    const int i = index_of(fledge_script.modes, fledge_script.n_modes, name);
    if (i < 0) {
        const mp_print_t *error = objects_error();
        mp_printf(error, "enter: %s has no mode '%s'; it has ", fledge_script.process, name);
        for (uint16_t k = 0u; k < fledge_script.n_modes; k++) {
            mp_printf(error, k ? ", %s" : "%s", fledge_script.modes[k]);
        }
        mp_print_str(error, fledge_script.n_modes ? "" : "none");
        objects_raise();
    }
    if (command_enter(&apart->context, (uint16_t)i) != COMMAND_OK) {
        objects_refuse("mode %s.%s: its condition does not hold", fledge_script.process, name);
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_2(flight_enter_object, flight_enter);

static const mp_rom_map_elem_t flight_methods_table[] = {
    {MP_ROM_QSTR(MP_QSTR_enter), MP_ROM_PTR(&flight_enter_object)}};
static MP_DEFINE_CONST_DICT(flight_methods, flight_methods_table);

static void flight_attribute(mp_obj_t self, qstr name, mp_obj_t *dest)
{
    (void)self;
    if (dest[0] != MP_OBJ_NULL) {
        objects_refuse("%s.%s cannot be set here; set parameters, as in f.control.K = 3", fledge_script.process,
                       qstr_str(name));
    }
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        if (strcmp(place_at(i)->name, qstr_str(name)) == 0) {
            dest[0] = copy_of(i);
            return;
        }
    }
    if (name == MP_QSTR_active_mode) {
        dest[0] = fledge_script.n_modes ? MP_OBJ_NEW_QSTR(qstr_from_str(fledge_script.modes[executive_mode()]))
                                        : mp_const_none;
    } else if (name == MP_QSTR_enter) {
        dest[1] = MP_OBJ_SENTINEL;
    } else {
        const mp_print_t *error = objects_error();
        mp_printf(error, "%s has no '%q' here; it has enter, active_mode", fledge_script.process, name);
        for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
            mp_printf(error, ", %s", place_at(i)->name);
        }
        objects_raise_as(&mp_type_AttributeError);
    }
}

static void flight_print(const mp_print_t *to, mp_obj_t self, mp_print_kind_t kind)
{
    (void)self;
    (void)kind;
    mp_printf(to, "<process %s>", fledge_script.process);
}

static MP_DEFINE_CONST_OBJ_TYPE(flight_type, MP_QSTR_Flight, MP_TYPE_FLAG_NONE, attr, flight_attribute, print,
                                flight_print, locals_dict, &flight_methods);
static const mp_obj_base_t flight_object = {&flight_type};

/* The result of wait(), to be yielded. */
static MP_DEFINE_CONST_OBJ_TYPE(pause_type, MP_QSTR_wait, MP_TYPE_FLAG_NONE);
static const mp_obj_base_t pause = {&pause_type};

static mp_obj_t wait(mp_obj_t time)
{
    const int64_t ns = objects_time(time, "wait");
    if (ns < 0 || ns > INT64_MAX - apart->context.t) {
        objects_refuse("wait: the time must be >= 0");
    }
    apart->wake = apart->context.t + ns;
    apart->waits = 1u;
    return MP_OBJ_FROM_PTR(&pause);
}
static MP_DEFINE_CONST_FUN_OBJ_1(wait_object, wait);

static mp_obj_t measure(mp_obj_t array, ExecMeasure kind)
{
    const ScriptNode *node = mp_obj_is_type(array, &script_array_type) ? MP_OBJ_TO_PTR(array) : NULL;
    const ScriptField *field = node != NULL ? objects_field_of(node) : NULL;
    if (field == NULL || field->type == FLEDGE_STRUCT || field->type == FLEDGE_CHAR) {
        const mp_print_t *error = objects_error();
        mp_printf(error, "%s: expected an array of a module or message; found ",
                  kind == EXEC_NORM ? "norm" : "max_abs");
        objects_print_found(error, array);
        objects_raise();
    }
    const FledgeType type = (FledgeType)field->type;
    return mp_obj_new_float(
        exec_measured(kind, type, objects_memory(node), objects_stride(field, node->level) / element_size(type)));
}

static mp_obj_t norm(mp_obj_t array)
{
    return measure(array, EXEC_NORM);
}
static MP_DEFINE_CONST_FUN_OBJ_1(norm_object, norm);

static mp_obj_t max_abs(mp_obj_t array)
{
    return measure(array, EXEC_MAX_ABS);
}
static MP_DEFINE_CONST_FUN_OBJ_1(max_abs_object, max_abs);

/* --- the end of a turn ----------------------------------------------------------------------------- */

static void begin_turn(Apart *a)
{
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        if (a->copies[i] != NULL) {
            memcpy(a->copies[i]->memory, memory_of(place_at(i)), place_at(i)->type->size);
        }
    }
    a->waits = 0u;
}

/* Refuse a change of all but parameters; a text may change all. */
static void check_change(const Apart *a, uint16_t i)
{
    const ScriptPlace *place = place_at(i);
    const uint8_t *now = a->copies[i]->memory;
    uint8_t *live = memory_of(place);
    for (uint32_t k = 0u; k < place->type->n; k++) {
        const ScriptField *field = &place->type->fields[k];
        const uint32_t size = objects_stride(field, 0);
        if (field->group == SCRIPT_PAR || memcmp(now + field->offset, live + field->offset, size) == 0) {
            continue;
        }
        if (!a->changes) {
            objects_refuse("%s.%s.%s is no parameter: a procedure cannot set it", fledge_script.process, place->name,
                           script_field_name(field));
        }
        memcpy(live + field->offset, now + field->offset, size);
    }
}

static void check_changes(const Apart *a)
{
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        if (a->copies[i] != NULL) {
            check_change(a, i);
        }
    }
}

/* Write the parameters that changed, from the first number to the last. Returns 0 if they are refused. */
static int write_changes(const Apart *a, uint16_t i, const mp_print_t *wrong)
{
    const ScriptPlace *place = place_at(i);
    if (place->block < 0) {
        return 1;
    }
    const CommandBlock *block = &a->context.table->blocks[place->block];
    const uint8_t *now = a->copies[i]->memory + place->parameters, *live = memory_of(place) + place->parameters;
    uint32_t low = 0u, high = block->size;
    while (low < high && now[low] == live[low]) {
        low++;
    }
    while (high > low && now[high - 1u] == live[high - 1u]) {
        high--;
    }
    if (low == high) {
        return 1;
    }
    while (exec_number_at(block->runs, block->n_runs, low) == 0u) {
        low--;
    }
    while (high < block->size && exec_number_at(block->runs, block->n_runs, high) == 0u) {
        high++;
    }
    uint16_t detail = 0u;
    const CommandReason reason =
        command_write(&a->context, (uint16_t)place->block, low, now + low, high - low, &detail);
    mp_printf(wrong, reason == COMMAND_OK ? "" : "%s.%s", fledge_script.process, place->name);
    if (reason == COMMAND_RULE) {
        mp_printf(wrong, ".%s must be %s", block->rules[detail].name, block->rules[detail].text);
    } else if (reason == COMMAND_INITIAL) {
        mp_printf(wrong, ".%s is an initial value: it counts only before flight's first instant",
                  block->rules[detail].name);
    } else if (reason != COMMAND_OK) {
        mp_printf(wrong, ": more than %d bytes of parameters from the first change to the last; yield in between",
                  COMMAND_DATA_MAX);
    }
    return reason == COMMAND_OK;
}

/* At the end of a turn, as the script: a module of the configuration may have an update of the script's own. Returns
 * NULL, or why a change is refused. */
static const char *end_turn(const Apart *a)
{
    static char memory[200];
    ScriptText text = {memory, sizeof memory, 0u};
    const mp_print_t wrong = script_text(&text);
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        if (a->copies[i] != NULL && !write_changes(a, i, &wrong)) {
            return memory;
        }
    }
    return NULL;
}

/* --- turns ----------------------------------------------------------------------------------------- */

static void begin_globals(Apart *a, const char *name)
{
    begin_names();
    a->copies = m_new0(ScriptRoot *, fledge_script.n_places);
    a->globals = MP_OBJ_TO_PTR(mp_obj_new_dict(8));
    const mp_obj_t globals = MP_OBJ_FROM_PTR(a->globals);
    mp_obj_dict_store(globals, MP_OBJ_NEW_QSTR(MP_QSTR___name__), MP_OBJ_NEW_QSTR(qstr_from_str(name)));
    mp_obj_dict_store(globals, MP_OBJ_NEW_QSTR(MP_QSTR_norm), MP_OBJ_FROM_PTR(&norm_object));
    mp_obj_dict_store(globals, MP_OBJ_NEW_QSTR(MP_QSTR_max_abs), MP_OBJ_FROM_PTR(&max_abs_object));
}

static mp_obj_t begin_procedure(Apart *a)
{
    begin_globals(a, "procedure");
    mp_obj_dict_store(MP_OBJ_FROM_PTR(a->globals), MP_OBJ_NEW_QSTR(MP_QSTR_wait), MP_OBJ_FROM_PTR(&wait_object));
    if (script_run_bytecode(slots[a->slot], a->n, a->globals) == MP_OBJ_NULL) {
        return MP_OBJ_NULL;
    }
    mp_map_elem_t *main = mp_map_lookup(&a->globals->map, MP_OBJ_NEW_QSTR(MP_QSTR_main), MP_MAP_LOOKUP);
    if (main == NULL) {
        objects_refuse("a procedure defines main(f)");
    }
    const mp_obj_t program = mp_call_function_1(main->value, MP_OBJ_FROM_PTR(&flight_object));
    if (!mp_obj_is_type(program, &mp_type_gen_instance) && program != mp_const_none) {
        objects_refuse("main(f) returns nothing, or yields");
    }
    return program;
}

/* True: it goes on; False: it has ended. */
static mp_obj_t turn(void *context)
{
    Apart *a = context;
    if (a->program == MP_OBJ_NULL) {
        const mp_obj_t begun = begin_procedure(a);
        if (begun == MP_OBJ_NULL) {
            return MP_OBJ_NULL;
        }
        a->program = begun;
    } else {
        begin_turn(a);
    }
    mp_obj_t value = mp_const_none;
    mp_vm_return_kind_t kind = MP_VM_RETURN_NORMAL;
    if (a->program != mp_const_none) {
        kind = mp_obj_gen_resume(a->program, mp_const_none, MP_OBJ_NULL, &value);
    }
    if (kind == MP_VM_RETURN_EXCEPTION) {
        nlr_raise(value);
    }
    if (kind == MP_VM_RETURN_YIELD && value != (a->waits ? MP_OBJ_FROM_PTR(&pause) : mp_const_none)) {
        objects_refuse("a procedure yields nothing, or wait(time)");
    }
    check_changes(a);
    return mp_obj_new_bool(kind == MP_VM_RETURN_YIELD);
}

void procedure_run(int64_t t)
{
    if (!procedure.runs || t < procedure.wake) {
        return;
    }
    procedure.context.t = t;
    const mp_obj_t result = run_apart(&procedure, turn);
    const char *wrong = result == MP_OBJ_NULL ? script_error() : end_turn(&procedure);
    if (wrong != NULL) {
        procedure.runs = 0u;
        report(&procedure, TELEMETRY_PROCEDURE_KILLED, result == MP_OBJ_NULL ? script_error_line() : 0u, wrong);
    } else if (result == mp_const_false) {
        procedure.runs = 0u;
        report(&procedure, TELEMETRY_PROCEDURE_ENDED, 0u, "");
    }
}

void procedure_forget(void)
{
    procedure.runs = 0u;
}

void procedure_end(void)
{
    if (procedure.runs) {
        procedure.runs = 0u;
        report(&procedure, TELEMETRY_PROCEDURE_STOPPED, 0u, "flight begins anew");
    }
}

/* --- commands -------------------------------------------------------------------------------------- */

static void begin_apart(Apart *a, const CommandContext *context, void *heap, size_t size, uint32_t turns)
{
    memset(a, 0, sizeof *a);
    a->context = *context;
    a->turns = turns;
    a->state = mp_state_ctx.vm;
    a->program = MP_OBJ_NULL;
    arena_begin(&a->arena, heap, size);
    a->arena.keeps = 1;
}

static CommandReason start(const CommandContext *context, uint16_t slot, uint32_t n, uint32_t turns)
{
    static uint64_t heap[HEAP / sizeof(uint64_t)];
    if (executive_failure() != NULL) {
        return COMMAND_ABSENT; /* there is no interpreter that runs */
    }
    if (procedure.runs) {
        return COMMAND_RUNNING;
    }
    if (!bytecode_is_sound(slots[slot], n, heap, sizeof heap)) {
        return COMMAND_BYTECODE;
    }
    begin_apart(&procedure, context, heap, sizeof heap, turns);
    procedure.slot = slot;
    procedure.n = n;
    procedure.runs = 1u;
    report(&procedure, TELEMETRY_PROCEDURE_STARTED, 0u, "");
    return COMMAND_OK;
}

static CommandReason stop(const CommandContext *context, uint16_t slot)
{
    if (!procedure.runs || procedure.slot != slot) {
        return COMMAND_RUNNING;
    }
    procedure.runs = 0u;
    procedure.context.t = context->t;
    report(&procedure, TELEMETRY_PROCEDURE_STOPPED, 0u, "by command");
    return COMMAND_OK;
}

#if MICROPY_ENABLE_COMPILER
typedef struct Text {
    Apart apart;
    const char *text;
    size_t n;
} Text;

static mp_obj_t run_text(void *context)
{
    static const qstr units[] = {MP_QSTR_m, MP_QSTR_s, MP_QSTR_kg, MP_QSTR_N, MP_QSTR_rad, MP_QSTR_deg};
    Text *t = context;
    begin_globals(&t->apart, "text");
    mp_obj_dict_t *globals = t->apart.globals;
    mp_obj_dict_store(MP_OBJ_FROM_PTR(globals), MP_OBJ_NEW_QSTR(MP_QSTR_f), MP_OBJ_FROM_PTR(&flight_object));
    for (size_t i = 0; i < MP_ARRAY_SIZE(units); i++) {
        mp_obj_dict_store(MP_OBJ_FROM_PTR(globals), MP_OBJ_NEW_QSTR(units[i]),
                          mp_load_attr(MP_OBJ_FROM_PTR(&script_units_module), units[i]));
    }
    const int lines = memchr(t->text, '\n', t->n) != NULL;
    const mp_obj_t result = script_run_text(t->text, t->n, "text", !lines, globals);
    if (result != MP_OBJ_NULL) {
        check_changes(&t->apart);
    }
    return result;
}

static CommandReason evaluate(const CommandContext *context, const uint8_t *text, uint32_t n, uint32_t turns)
{
    static uint64_t heap[TEXT_HEAP / sizeof(uint64_t)];
    static Text entered;
    if (executive_failure() != NULL) {
        return COMMAND_ABSENT;
    }
    begin_apart(&entered.apart, context, heap, sizeof heap, turns);
    entered.apart.changes = 1u;
    entered.text = (const char *)text;
    entered.n = n;
    const char *wrong = run_apart(&entered.apart, run_text) == MP_OBJ_NULL ? script_error() : end_turn(&entered.apart);
    printed.text[printed.n] = '\0';
    report(&entered.apart, wrong == NULL ? TELEMETRY_RESULT : TELEMETRY_ERROR, 0u,
           wrong == NULL ? printed.text : wrong);
    return wrong == NULL ? COMMAND_OK : COMMAND_FAILED;
}
#else
static CommandReason evaluate(const CommandContext *context, const uint8_t *text, uint32_t n, uint32_t turns)
{
    (void)context;
    (void)text;
    (void)n;
    (void)turns;
    return COMMAND_ABSENT;
}
#endif

const CommandProcedures script_procedures = {slots[0], ROOM, SLOTS, MICROPY_ENABLE_COMPILER, start, stop, evaluate};

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/script.h"

#include <string.h>

#include <py/builtin.h>
#include <py/compile.h>
#include <py/cstack.h>
#include <py/lexer.h>
#include <py/mperrno.h>
#include <py/objexcept.h>
#include <py/objstr.h>
#include <py/parse.h>
#include <py/persistentcode.h>
#include <py/runtime.h>

enum {
    FRAMES = 6144,     /* [bytes] of the stack of frames: some 40 calls deep */
    STACK = 48 * 1024, /* [bytes] of the C stack that the interpreter may use */
    EXPLANATION = 500, /* [turns] to print why a script failed */
    NOTHING_LEFT = 1   /* a script over its limit may do so much more: nothing */
};

void (*script_out)(const char *text, size_t n);
uint32_t script_turns;

static uint64_t frames[FRAMES / sizeof(uint64_t)];
static nlr_buf_t *guard; /* of the innermost script_guard */
static uint32_t limit;   /* 0: none */
static char failure[256];
static uint32_t failure_line;

/* Of a script that is over its limit. It has a place from its first raise on. */
static mp_obj_exception_t over_limit;

/* ---- texts into memory of fixed size */

static void add(void *context, const char *text, size_t n)
{
    ScriptText *t = context;
    const size_t room = t->size - 1u - t->n;
    n = n < room ? n : room;
    memcpy(t->at + t->n, text, n);
    t->n += n;
    t->at[t->n] = '\0';
}

mp_print_t script_text(ScriptText *text)
{
    text->n = 0u;
    text->at[0] = '\0';
    return (mp_print_t){text, add};
}

static void put_place(const mp_print_t *print, qstr file, size_t line)
{
    failure_line = (uint32_t)line;
    mp_printf(print, "%q, line %u: ", file, (unsigned)line);
}

/* The place of the innermost script, then the exception. */
static void explain(mp_obj_t exception)
{
    ScriptText text = {failure, sizeof failure, 0};
    const mp_print_t print = script_text(&text);
    failure_line = 0u;
    if (!mp_obj_is_exception_instance(exception)) {
        mp_obj_print_helper(&print, exception, PRINT_REPR);
        return;
    }
    size_t n, *places;
    mp_obj_exception_get_traceback(exception, &n, &places);
    if (n >= 3u) {
        put_place(&print, (qstr)places[0], places[1]);
    }
    const mp_obj_type_t *type = mp_obj_get_type(exception);
    if (exception == MP_OBJ_FROM_PTR(&over_limit)) {
        mp_printf(&print, "it takes more than %u turns of loops and returns", (unsigned)limit);
    } else if (type == &mp_type_MemoryError && arena_in_use->locked) {
        mp_printf(&print, "MemoryError: this allocates %u bytes, but after the start nothing may allocate",
                  (unsigned)arena_in_use->wanted);
    } else if (type == &mp_type_MemoryError) {
        mp_printf(&print, "MemoryError: the heap of %u bytes has no %u bytes left", (unsigned)arena_in_use->size,
                  (unsigned)arena_in_use->wanted);
    } else {
        mp_obj_print_helper(&print, exception, PRINT_EXC);
    }
}

/* An object in the exception may hold itself, or print itself by a method of the script: so its text has a limit of its
 * own, where it ends. */
static void explain_within_limit(mp_obj_t exception)
{
    const uint32_t left = script_turns, most = limit;
    nlr_buf_t here;
    if (nlr_push(&here) == 0) {
        guard = &here;
        limit = most != 0u ? most : EXPLANATION;
        script_turns = EXPLANATION;
        explain(exception);
        nlr_pop();
    }
    limit = most;
    script_turns = left;
}

const char *script_error(void)
{
    return failure;
}

uint32_t script_error_line(void)
{
    return failure_line;
}

void script_print(const char *text, size_t n)
{
    if (script_out) {
        script_out(text, n);
    }
}

/* ---- calls that return */

mp_obj_t script_guard(mp_obj_t (*run)(void *), void *context)
{
    nlr_buf_t *const outer = guard;
    mp_obj_dict_t *const globals = mp_globals_get(), *const locals = mp_locals_get();
    mp_obj_t result = MP_OBJ_NULL;
    nlr_buf_t here;
    if (outer == NULL) {
        mp_cstack_init_with_sp_here(STACK);
    }
    if (nlr_push(&here) == 0) {
        guard = &here;
        result = run(context);
        nlr_pop();
    } else {
        mp_globals_set(globals);
        mp_locals_set(locals);
        explain_within_limit(MP_OBJ_FROM_PTR(here.ret_val));
    }
    guard = outer;
    return result;
}

typedef struct Call {
    mp_obj_t function;
    size_t n;
    const mp_obj_t *arguments;
} Call;

static mp_obj_t call(void *context)
{
    const Call *c = context;
    return mp_call_function_n_kw(c->function, c->n, 0, c->arguments);
}

mp_obj_t script_call(mp_obj_t function, size_t n, const mp_obj_t *arguments)
{
    Call c = {function, n, arguments};
    return script_guard(call, &c);
}

static mp_obj_t import(void *context)
{
    const char *name = context;
    /* The value of the import is the package of a dotted name, unless names of the module are requested. */
    mp_obj_t from = mp_const_true;
    return mp_import_name(qstr_from_str(name), from, MP_OBJ_NEW_SMALL_INT(0));
}

mp_obj_t script_import(const char *module)
{
    return script_guard(import, (void *)(uintptr_t)module);
}

typedef struct Bytecode {
    const uint8_t *bytes;
    size_t n;
    mp_obj_dict_t *globals;
} Bytecode;

static mp_obj_t run_bytecode(void *context)
{
    const Bytecode *b = context;
    mp_module_context_t *module = m_new_obj(mp_module_context_t);
    module->module.base.type = &mp_type_module;
    module->module.globals = b->globals;
    mp_compiled_module_t compiled = {.context = module};
    mp_raw_code_load_mem(b->bytes, b->n, &compiled);
    mp_globals_set(b->globals);
    mp_locals_set(b->globals);
    return mp_call_function_0(mp_make_function_from_proto_fun(compiled.rc, module, NULL));
}

mp_obj_t script_run_bytecode(const uint8_t *bytes, size_t n, mp_obj_dict_t *globals)
{
    mp_obj_dict_t *const outer = mp_globals_get(), *const locals = mp_locals_get();
    Bytecode b = {bytes, n, globals};
    const mp_obj_t result = script_guard(run_bytecode, &b);
    mp_globals_set(outer);
    mp_locals_set(locals);
    return result;
}

#if MICROPY_ENABLE_COMPILER
typedef struct Source {
    const char *text, *name;
    size_t n;
    mp_parse_input_kind_t kind;
    mp_obj_dict_t *globals;
} Source;

static mp_obj_t run_text(void *context)
{
    const Source *s = context;
    mp_lexer_t *lexer = mp_lexer_new_from_str_len(qstr_from_str(s->name), s->text, s->n, 0);
    return mp_parse_compile_execute(lexer, s->kind, s->globals, s->globals);
}

mp_obj_t script_run_text(const char *text, size_t n, const char *name, int interactive, mp_obj_dict_t *globals)
{
    Source s = {text, name, n, interactive ? MP_PARSE_SINGLE_INPUT : MP_PARSE_FILE_INPUT, globals};
    return script_guard(run_text, &s);
}
#endif

/* ---- budgets */

void script_limit(uint32_t turns)
{
    limit = turns;
    over_limit = (mp_obj_exception_t){.base = {&mp_type_RuntimeError}};
    over_limit.args = (mp_obj_tuple_t *)(void *)&mp_const_empty_tuple_obj;
    script_turns = turns + NOTHING_LEFT;
}

uint32_t script_left(void)
{
    return limit != 0u ? script_turns - NOTHING_LEFT : UINT32_MAX;
}

void script_turned(void)
{
    if (limit == 0u || !guard) {
        return;
    }
    script_turns = NOTHING_LEFT;
    if (over_limit.traceback_data) {
        MP_STATE_THREAD(nlr_top) = guard; /* past all that the script catches */
    }
    nlr_jump(&over_limit); /* at first as any exception, so that it gets its place */
}

void script_step(void)
{
    MICROPY_VM_HOOK_LOOP
    mp_cstack_check();
}

/* ---- start, and the functions of the interpreter's port */

void script_start(Arena *arena)
{
    arena_in_use = arena;
    guard = NULL;
    script_limit(0u);
    mp_cstack_init_with_sp_here(STACK);
    mp_pystack_init(frames, frames + sizeof frames / sizeof *frames);
    mp_init();
    mp_sys_path = mp_obj_new_list(0, NULL);
    mp_obj_list_append(mp_sys_path, MP_OBJ_NEW_QSTR(MP_QSTR__dot_frozen));
}

/* Scripts are frozen: there are no files. */
mp_import_stat_t mp_import_stat(const char *path)
{
    (void)path;
    return MP_IMPORT_STAT_NO_EXIST;
}

#if MICROPY_ENABLE_COMPILER
mp_lexer_t *mp_lexer_new_from_file(qstr name)
{
    (void)name;
    mp_raise_OSError(MP_ENOENT);
}
#endif

_Noreturn void script_broken(void)
{
    mp_raise_msg(&mp_type_RuntimeError, MP_ERROR_TEXT("an object is of the wrong type here, or changed while in use"));
}

/* An exception without a guard is a fault of the C code around the interpreter. */
void nlr_jump_fail(void *exception)
{
    (void)exception;
    for (;;) {
    }
}

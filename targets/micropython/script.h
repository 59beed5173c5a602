/* SPDX-License-Identifier: Apache-2.0 */
/* The interpreter as flight uses it: start, import of a frozen script, calls that return where a script fails, the text
 * of what went wrong, and a budget. */
#ifndef TARGETS_MICROPYTHON_SCRIPT_H
#define TARGETS_MICROPYTHON_SCRIPT_H

#include "targets/micropython/arena.h"
#include <py/obj.h>

/** Start the interpreter. The arena, which the caller has begun, is its heap. At each call it begins anew. */
void script_start(Arena *arena);

/** Import a frozen module, "nadir_spin.flight", and return it; MP_OBJ_NULL if that fails: script_error(). */
mp_obj_t script_import(const char *module);

/** Call a function of a script. Returns its result, or MP_OBJ_NULL: script_error(). */
mp_obj_t script_call(mp_obj_t function, size_t n, const mp_obj_t *arguments);

/** Call a C function that may raise. Returns its result, or MP_OBJ_NULL: script_error(). The globals of the interpreter
 *  are restored afterwards. Calls may nest. */
mp_obj_t script_guard(mp_obj_t (*run)(void *), void *context);

/** Run bytecode, as compile_mpy() of the toolchain makes it, with these globals. As script_call. */
mp_obj_t script_run_bytecode(const uint8_t *bytes, size_t n, mp_obj_dict_t *globals);

/** The last failure: "nadir_spin/flight.py, line 12: ValueError: ...". Never NULL. It stays until the next failure. */
const char *script_error(void);

/** A script may make so many turns of loops and returns of functions, counted from now; 0: any number. A script that
 *  makes more ends, whatever it catches, and the innermost script_call or script_guard that surrounds it returns
 *  MP_OBJ_NULL. */
void script_limit(uint32_t turns);

/** The line of script_error(); 0: none. */
uint32_t script_error_line(void);

/** A text in memory of fixed size, to which it is cut. */
typedef struct ScriptText {
    char *at;
    size_t size, n; ///< [bytes] of the memory; of the text
} ScriptText;

/** Begin a text, for mp_printf and other functions that print. */
mp_print_t script_text(ScriptText *text);

/** How many turns a script has left of its limit. */
uint32_t script_left(void);

/** The output of `print`; NULL: none. */
extern void (*script_out)(const char *text, size_t n);

#if MICROPY_ENABLE_COMPILER
/** Compile and run a text. interactive: one statement, as at a prompt, whose value is printed. As script_call. */
mp_obj_t script_run_text(const char *text, size_t n, const char *name, int interactive, mp_obj_dict_t *globals);
#endif

#endif

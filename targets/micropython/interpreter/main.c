/* SPDX-License-Identifier: Apache-2.0 */
/* A script without a mission: runs the frozen module `script`, or, in a build of development, the file of its argument.
 * The script's functions `init` and `loop`, if it has them, run as flight runs them: `init` once, then the arena is
 * locked, and `loop` runs SCRIPT_CYCLES times. At the end it prints what the heap was. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "targets/micropython/script.h"
#include <py/runtime.h>

#ifndef SCRIPT_HEAP
#define SCRIPT_HEAP (256 * 1024)
#endif
#ifndef SCRIPT_CYCLES
#define SCRIPT_CYCLES 100
#endif

static uint64_t heap[SCRIPT_HEAP / sizeof(uint64_t)];
static Arena arena;

static void out(const char *text, size_t n)
{
    fwrite(text, 1, n, stdout);
}

/* A global of the script; MP_OBJ_NULL: it has none of that name. */
static mp_obj_t global(const mp_obj_dict_t *globals, qstr name)
{
    mp_map_elem_t *entry = mp_map_lookup((mp_map_t *)(uintptr_t)&globals->map, MP_OBJ_NEW_QSTR(name), MP_MAP_LOOKUP);
    return entry ? entry->value : MP_OBJ_NULL;
}

static int failed(void)
{
    fflush(stdout);
    fprintf(stderr, "%s\n", script_error());
    return 1;
}

#if MICROPY_ENABLE_COMPILER
static char text[256 * 1024];

static mp_obj_t run_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file) {
        fprintf(stderr, "%s cannot be read\n", path);
        exit(1);
    }
    const size_t n = fread(text, 1, sizeof text, file);
    fclose(file);
    return script_run_text(text, n, path, 0, mp_globals_get());
}
#endif

int main(int argc, char **argv)
{
    arena_begin(&arena, heap, sizeof heap);
    script_start(&arena);
    script_out = out;
    const mp_obj_dict_t *globals = mp_globals_get();
    const size_t started = arena.used;
#if MICROPY_ENABLE_COMPILER
    if (argc > 1) {
        if (run_file(argv[1]) == MP_OBJ_NULL) {
            return failed();
        }
    } else
#endif
    {
        const mp_obj_t module = script_import("script");
        if (module == MP_OBJ_NULL) {
            return failed();
        }
        globals = mp_obj_module_get_globals(module);
    }
    (void)argc;
    (void)argv;
    const mp_obj_t init = global(globals, qstr_from_str("init")), loop = global(globals, qstr_from_str("loop"));
    if (init != MP_OBJ_NULL && script_call(init, 0, NULL) == MP_OBJ_NULL) {
        return failed();
    }
    const size_t peak = arena.peak, flat = arena.used;
    arena.locked = 1;
    for (int i = 0; loop != MP_OBJ_NULL && i < SCRIPT_CYCLES; i++) {
        if (script_call(loop, 0, NULL) == MP_OBJ_NULL) {
            return failed();
        }
    }
    printf("heap: %u bytes at the start, %u at most until the loop, %u in the loop, %u after it\n", (unsigned)started,
           (unsigned)peak, (unsigned)flat, (unsigned)arena.used);
    return 0;
}

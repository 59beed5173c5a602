/* SPDX-License-Identifier: Apache-2.0 */
/* Runs the file of its argument with a mission's types. `memory(x)` gives it the bytes of a module or message as
 * hexadecimal digits, `place(x, name)` gives a module its name, and `bits(x)` the bits of a double. */
#include "targets/micropython/objects.h"
#include "targets/micropython/script.h"

#include <py/runtime.h>

#include <stdio.h>
#include <string.h>

static uint64_t heap[1u << 22];
static Arena arena;
static char text[1u << 22];

static void out(const char *text, size_t n)
{
    fwrite(text, 1, n, stdout);
}

static mp_obj_t memory(mp_obj_t object)
{
    const ScriptNode *node = objects_struct(object);
    const uint8_t *bytes = objects_memory(node);
    for (uint32_t i = 0; i < node->type->size; i++) {
        sprintf(text + 2u * i, "%02x", bytes[i]);
    }
    return mp_obj_new_str(text, 2u * node->type->size);
}
static MP_DEFINE_CONST_FUN_OBJ_1(memory_object, memory);

static mp_obj_t place(mp_obj_t object, mp_obj_t name)
{
    for (uint16_t i = 0; i < fledge_script.n_places; i++) {
        if (!strcmp(fledge_script.places[i].name, mp_obj_str_get_str(name))) {
            objects_place(object, i);
        }
    }
    return object;
}
static MP_DEFINE_CONST_FUN_OBJ_2(place_object, place);

static mp_obj_t bits(mp_obj_t number)
{
    const double x = mp_obj_get_float(number);
    uint64_t word;
    memcpy(&word, &x, sizeof word);
    return mp_obj_new_str(text, (size_t)sprintf(text, "%016llx", (unsigned long long)word));
}
static MP_DEFINE_CONST_FUN_OBJ_1(bits_object, bits);

static mp_obj_t lock(mp_obj_t on)
{
    arena.locked = mp_obj_is_true(on);
    return MP_OBJ_NEW_SMALL_INT(arena.used);
}
static MP_DEFINE_CONST_FUN_OBJ_1(lock_object, lock);

int main(int argc, char **argv)
{
    arena_begin(&arena, heap, sizeof heap);
    script_start(&arena);
    script_out = out;
    mp_store_global(qstr_from_str("memory"), MP_OBJ_FROM_PTR(&memory_object));
    mp_store_global(qstr_from_str("place"), MP_OBJ_FROM_PTR(&place_object));
    mp_store_global(qstr_from_str("bits"), MP_OBJ_FROM_PTR(&bits_object));
    mp_store_global(qstr_from_str("lock"), MP_OBJ_FROM_PTR(&lock_object));
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    if (!file) {
        return 2;
    }
    static char script[1u << 22];
    const size_t n = fread(script, 1, sizeof script, file);
    fclose(file);
    if (script_run_text(script, n, argv[1], 0, mp_globals_get()) == MP_OBJ_NULL) {
        fflush(stdout);
        fprintf(stderr, "%s\n", script_error());
        return 1;
    }
    return 0;
}

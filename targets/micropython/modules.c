/* SPDX-License-Identifier: Apache-2.0 */
/* The modules fledge, fledge.flight and fledge.world of a script, and the substitute for the world. */
#include "targets/micropython/objects.h"
#include "targets/micropython/units.h"

#include <py/runtime.h>

#include <string.h>

/* Of a script without a mission. */
__attribute__((weak)) const ScriptMission fledge_script = {.process = "flight"};

// --- the substitute for the world --------------------------------------------------------------------

const mp_obj_base_t script_inert = {&script_inert_type};

static void inert_attribute(mp_obj_t object, qstr name, mp_obj_t *dest)
{
    (void)name;
    dest[0] = dest[0] == MP_OBJ_NULL ? object : MP_OBJ_NULL;
}

static mp_obj_t inert_call(mp_obj_t object, size_t n, size_t n_keywords, const mp_obj_t *arguments)
{
    (void)n;
    (void)n_keywords;
    (void)arguments;
    return object;
}

static mp_obj_t inert_binary(mp_binary_op_t op, mp_obj_t left, mp_obj_t right)
{
    (void)right;
    return op == MP_BINARY_OP_EQUAL || op == MP_BINARY_OP_CONTAINS ? mp_const_false : left;
}

static mp_obj_t inert_unary(mp_unary_op_t op, mp_obj_t object)
{
    switch (op) {
    case MP_UNARY_OP_POSITIVE:
    case MP_UNARY_OP_NEGATIVE:
    case MP_UNARY_OP_INVERT:
    case MP_UNARY_OP_ABS: return object;
    case MP_UNARY_OP_BOOL: return mp_const_true;
    case MP_UNARY_OP_LEN: return MP_OBJ_NEW_SMALL_INT(0);
    default: return MP_OBJ_NULL;
    }
}

static mp_obj_t inert_subscript(mp_obj_t object, mp_obj_t index, mp_obj_t value)
{
    (void)index;
    return value == MP_OBJ_SENTINEL ? object : mp_const_none;
}

static mp_obj_t inert_iterate(mp_obj_t object, mp_obj_iter_buf_t *buffer)
{
    return objects_iterate(object, 0, buffer);
}

static void inert_print(const mp_print_t *print, mp_obj_t object, mp_print_kind_t kind)
{
    (void)object;
    (void)kind;
    mp_print_str(print, "<of the world or another process>");
}

MP_DEFINE_CONST_OBJ_TYPE(script_inert_type, MP_QSTR_world, MP_TYPE_FLAG_ITER_IS_GETITER, print, inert_print, call,
                         inert_call, unary_op, inert_unary, binary_op, inert_binary, attr, inert_attribute, subscr,
                         inert_subscript, iter, inert_iterate);

static mp_obj_t inert_named(mp_obj_t name)
{
    (void)name;
    return MP_OBJ_FROM_PTR(&script_inert);
}
static MP_DEFINE_CONST_FUN_OBJ_1(inert_named_object, inert_named);

/* The result that the export has computed, in place of the world's function. */
static mp_obj_t world_named(mp_obj_t name)
{
    mp_obj_t attribute[2] = {MP_OBJ_NULL, MP_OBJ_NULL};
    if (fledge_script.computed) {
        const mp_obj_t module = mp_import_name(MP_QSTR_fledge_computed, mp_const_none, MP_OBJ_NEW_SMALL_INT(0));
        mp_load_method_maybe(module, mp_obj_str_get_qstr(name), attribute);
    }
    return attribute[0] != MP_OBJ_NULL ? attribute[0] : MP_OBJ_FROM_PTR(&script_inert);
}
static MP_DEFINE_CONST_FUN_OBJ_1(world_named_object, world_named);

static const mp_rom_map_elem_t world_table[] = {
    {MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_world)},
    {MP_ROM_QSTR(MP_QSTR___getattr__), MP_ROM_PTR(&world_named_object)},
};
static MP_DEFINE_CONST_DICT(world_globals, world_table);
static const mp_obj_module_t world_module = {.base = {&mp_type_module}, .globals = (mp_obj_dict_t *)&world_globals};

// --- fledge.flight ---------------------------------------------------------------------------------

/* A constant: rows of numbers. */
static mp_obj_t rows_of(const ScriptConstant *constant)
{
    mp_obj_list_t *rows = MP_OBJ_TO_PTR(mp_obj_new_list(constant->shape[0], NULL));
    const double *x = constant->numbers;
    for (uint32_t i = 0; i < constant->shape[0]; i++) {
        mp_obj_list_t *row = MP_OBJ_TO_PTR(mp_obj_new_list(constant->shape[1], NULL));
        for (uint32_t k = 0; k < constant->shape[1]; k++) {
            row->items[k] = mp_obj_new_float(*x++);
        }
        rows->items[i] = MP_OBJ_FROM_PTR(row);
    }
    return MP_OBJ_FROM_PTR(rows);
}

static mp_obj_t flight_named(mp_obj_t name)
{
    const char *text = mp_obj_str_get_str(name);
    for (uint32_t i = 0; i < fledge_script.n_types; i++) {
        if (!strcmp(fledge_script.types[i]->name, text)) {
            return MP_OBJ_FROM_PTR(fledge_script.types[i]);
        }
    }
    for (uint32_t i = 0; i < fledge_script.n_enums; i++) {
        if (!strcmp(fledge_script.enums[i].name, text)) {
            return MP_OBJ_FROM_PTR(&fledge_script.enums[i]);
        }
    }
    for (uint32_t i = 0; i < fledge_script.n_constants; i++) {
        if (!strcmp(fledge_script.constants[i].name, text)) {
            return rows_of(&fledge_script.constants[i]);
        }
    }
    if (fledge_script.whole) {
        return MP_OBJ_FROM_PTR(&script_inert); /* another process may have it */
    }
    const mp_print_t *error = objects_error();
    mp_printf(error, "fledge.flight has no '%s' on this target; there are ", text);
    const char *between = "";
    for (uint32_t i = 0; i < fledge_script.n_types; i++) {
        if (fledge_script.types[i]->update) {
            mp_printf(error, "%s%s", between, fledge_script.types[i]->name);
            between = ", ";
        }
    }
    objects_raise_as(&mp_type_AttributeError);
}
static MP_DEFINE_CONST_FUN_OBJ_1(flight_named_object, flight_named);

static const mp_rom_map_elem_t flight_table[] = {
    {MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_flight)},
    {MP_ROM_QSTR(MP_QSTR_newest), MP_ROM_PTR(&script_newest)},
    {MP_ROM_QSTR(MP_QSTR_first), MP_ROM_PTR(&script_first)},
    {MP_ROM_QSTR(MP_QSTR_best), MP_ROM_PTR(&script_best)},
    {MP_ROM_QSTR(MP_QSTR_by_mode), MP_ROM_PTR(&script_by_mode)},
    {MP_ROM_QSTR(MP_QSTR___getattr__), MP_ROM_PTR(&flight_named_object)},
};
static MP_DEFINE_CONST_DICT(flight_globals, flight_table);
static const mp_obj_module_t flight_module = {.base = {&mp_type_module}, .globals = (mp_obj_dict_t *)&flight_globals};

// --- fledge ----------------------------------------------------------------------------------------

static const mp_rom_map_elem_t fledge_table[] = {
    {MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_fledge)},
    {MP_ROM_QSTR(MP_QSTR___path__), MP_ROM_QSTR(MP_QSTR_fledge)}, /* an import of another part finds nothing there */
    {MP_ROM_QSTR(MP_QSTR_flight), MP_ROM_PTR(&flight_module)},
    {MP_ROM_QSTR(MP_QSTR_units), MP_ROM_PTR(&script_units_module)},
    {MP_ROM_QSTR(MP_QSTR_world), MP_ROM_PTR(&world_module)},
    {MP_ROM_QSTR(MP_QSTR_Quantity), MP_ROM_PTR(&script_quantity_type)},
    {MP_ROM_QSTR(MP_QSTR_SetupError), MP_ROM_PTR(&mp_type_SetupError)},
    {MP_ROM_QSTR(MP_QSTR___getattr__), MP_ROM_PTR(&inert_named_object)}, /* Orbit and the like */
};
static MP_DEFINE_CONST_DICT(fledge_globals, fledge_table);
const mp_obj_module_t script_fledge_module = {.base = {&mp_type_module}, .globals = (mp_obj_dict_t *)&fledge_globals};
MP_REGISTER_MODULE(MP_QSTR_fledge, script_fledge_module);

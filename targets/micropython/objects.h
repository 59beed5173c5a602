/* SPDX-License-Identifier: Apache-2.0 */
/* The Python objects of a script: modules, messages, nested structs and arrays as views of C memory, wires, quantities,
 * and the substitute for the world. All of a script's errors are SetupError, as on the desktop.
 *
 * A view holds its owner and an offset, no address: when a module moves to its place in the mission's memory, its views
 * follow. An object keeps the views that were made of it, so that reading an attribute a second time allocates
 * nothing. */
#ifndef TARGETS_MICROPYTHON_OBJECTS_H
#define TARGETS_MICROPYTHON_OBJECTS_H

#include "targets/micropython/tables.h"

#include <py/obj.h>

/** The head of all views. A module, or a message that a script has made itself, is its own root. */
typedef struct ScriptNode {
    mp_obj_base_t base;
    struct ScriptNode *owner; ///< NULL: it is a root
    struct ScriptNode *views; ///< the first view of it
    struct ScriptNode *next;  ///< of its owner's views
    const ScriptType *type;   ///< of a module, message or struct; NULL: an array
    uint32_t offset;          ///< [bytes] in the root's memory
    uint16_t field;           ///< the index in the owner's type; of a part of an array, of the array
    uint16_t row;             ///< of an array of structs; of a part of an array, its index
    uint8_t level;            ///< of an array: how many dimensions its indices have used up
} ScriptNode;

typedef struct ScriptRoot {
    ScriptNode node;
    uint8_t *memory;
    mp_obj_t update; ///< the script's own functions, of `update=` and `reset=`; MP_OBJ_NULL: those of C
    mp_obj_t reset;
    uint32_t turns;   ///< that a call of them may take
    int16_t place;    ///< the index in fledge_script.places; -1: it has none
    uint8_t given[2]; ///< a bit for each field: whether the script gave it. There are more behind it for long types
} ScriptRoot;

/** An output, or several of which an input takes one: `newest(a.torque, b.torque)`. */
typedef struct ScriptChoice {
    mp_obj_base_t base;
    uint32_t by; ///< ExecChoice
    uint32_t n;
    struct {
        ScriptNode *output;
        const char *mode; ///< of by_mode, else NULL
    } of[];
} ScriptChoice;

/** `source >> target`, or `source >> [a, b]` without those that stand in for the world. */
typedef struct ScriptWire {
    mp_obj_base_t base;
    const ScriptChoice *source;
    int64_t stale_after; ///< [ns]; 0: never
    int32_t latency;     ///< [exchanges]
    uint32_t n;
    ScriptNode *targets[];
} ScriptWire;

extern const mp_obj_type_t script_module_type, script_view_type, script_array_type, script_wire_type;
extern const mp_obj_fun_builtin_var_t script_newest, script_first, script_best, script_by_mode;
extern const mp_obj_type_t script_inert_type, mp_type_SetupError;

/** The substitute for the world and other processes: it accepts everything, gives itself, and allocates nothing. */
extern const mp_obj_base_t script_inert;

static inline int objects_is_inert(mp_obj_t o)
{
    return mp_obj_is_obj(o) && mp_obj_get_type(o) == &script_inert_type;
}

/** A module, or NULL. */
ScriptRoot *objects_module(mp_obj_t value);

/** A module, message or nested struct, or NULL. */
ScriptNode *objects_struct(mp_obj_t value);

static inline ScriptRoot *objects_root(const ScriptNode *node)
{
    while (node->owner) {
        node = node->owner;
    }
    return (ScriptRoot *)node;
}

static inline uint8_t *objects_memory(const ScriptNode *node)
{
    return objects_root(node)->memory + node->offset;
}

/** Whether a view is a module, not a message or a part. */
static inline int objects_is_module(const ScriptNode *node)
{
    return !node->owner && node->type->reset;
}

/** [bytes] of a field behind `level` indices; 0: of the whole field. */
uint32_t objects_stride(const ScriptField *field, uint32_t level);

/** `f.NAME = module`, NAME being that of fledge_script.places[place], which has no module yet: move its bytes there.
 *  Raises for an object that is no module, for another type, and for a module that has a place. */
void objects_place(mp_obj_t module, uint16_t place);

/** All that check_parameters finds on the desktop: raises for a required parameter that the script has not given, and
 *  for one that breaks its rule. */
void objects_check(const ScriptRoot *module);

/** Make all views of a module now, so that its own `update` allocates none under the lock. */
void objects_make_views(ScriptNode *node);

/** The field of that name, or NULL. */
const ScriptField *objects_field(const ScriptType *type, const char *name);

/** The view of a nested struct: makes it if it is new. row: of an array of structs, else 0. */
ScriptNode *objects_view(ScriptNode *owner, const ScriptField *field, uint16_t row);

/** The field of the port or nested struct that a view is, in its owner's type; NULL of a root. */
const ScriptField *objects_field_of(const ScriptNode *node);

/** Rows that count, of an array. */
uint32_t objects_rows(const ScriptNode *owner, const ScriptField *field);

/** "flight.control.torque", "MrpFeedback" of an object without a place. */
void objects_print_path(const mp_print_t *print, const ScriptNode *node);

/** Called after a script has set something of the module of a place; NULL: nothing is. */
extern void (*objects_changed)(uint16_t place);

/** Assign to a field: converts, checks, and leaves the memory as it was on failure. */
void objects_store(ScriptNode *node, const ScriptField *field, mp_obj_t value);

/** The bytes that an assignment would write: [0] of the field, or of its element `index` (-1: whole), [1] of its count
 *  if that changes. Returns how many. offset: in the root. The bytes lie in the arena. */
typedef struct ScriptBytes {
    uint32_t offset;
    uint32_t size;
    uint8_t *bytes;
} ScriptBytes;
int objects_encode(ScriptNode *node, const ScriptField *field, int32_t index, mp_obj_t value, ScriptBytes out[2]);

/** A constant to compare a field with, in the header's unit: a quantity, a number, or an enumerator. Raises with `name`
 *  in front: "flight.tracking.error.sigma_BR". */
double objects_constant(const ScriptField *field, mp_obj_t value, const char *name);

/** [ns] A time, a quantity or a number of seconds. subject: the beginning of the error: "task gnc: every". */
int64_t objects_time(mp_obj_t value, const char *subject);

/** Raise SetupError, with a format of mp_printf. Under the lock too: the text lies in static memory. */
NORETURN void objects_refuse(const char *format, ...);

/** The same for a longer text: print it to objects_error(), then raise. */
const mp_print_t *objects_error(void);
NORETURN void objects_raise(void);
NORETURN void objects_raise_as(const mp_obj_type_t *type);

/** The repr of a value, on one line of at most 80 characters. */
void objects_print_found(const mp_print_t *print, mp_obj_t value);

/** An array as nested lists, of anything else the value itself. */
mp_obj_t objects_plain(mp_obj_t value);

/** An iterator over the items 0 ... n - 1 of an object, in the buffer. */
mp_obj_t objects_iterate(mp_obj_t object, size_t n, mp_obj_iter_buf_t *buffer);

/** The names of a type's fields of a group, or of all (-1), with commas between them. */
void objects_print_names(const mp_print_t *print, const ScriptType *type, int group);

#endif

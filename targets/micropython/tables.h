/* SPDX-License-Identifier: Apache-2.0 */
/* The tables that `fledge export micropython` writes of a mission for its script: the types of its modules and
 * messages, the places of its modules in the mission's memory, and the inputs of flight from outside. All tables are
 * constant. Names are texts, so that one interpreter serves all missions. */
#ifndef TARGETS_MICROPYTHON_TABLES_H
#define TARGETS_MICROPYTHON_TABLES_H

#include "flight/command/command.h"
#include "flight/exec/element.h"
#include "flight/msg/head.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SCRIPT_DIMENSIONS = 3, SCRIPT_NO_FIELD = 0xFF };

/** As FledgeGroup in sim/table.h. */
typedef enum ScriptGroup { SCRIPT_NONE, SCRIPT_IN, SCRIPT_OUT, SCRIPT_PAR, SCRIPT_MEM } ScriptGroup;

enum { SCRIPT_REQUIRED = 1 << 0 }; ///< a parameter that the script must give

typedef struct ScriptEnumerator {
    const char *name; ///< as in the header: "QUALITY_GOOD"
    int32_t value;
} ScriptEnumerator;

struct _mp_obj_type_t;
extern const struct _mp_obj_type_t script_class_type, script_enum_type;

/** An enumeration is an object of Python, whose attributes are the numbers of its names: fsw.Quality.GOOD. */
typedef struct ScriptEnum {
    const struct _mp_obj_type_t *base; ///< script_enum_type
    const char *name;
    const ScriptEnumerator *values;
    uint16_t n;
} ScriptEnum;

/** A unit of the headers. All are of the SI, but "ns". */
typedef struct ScriptUnit {
    const char *text; ///< "N m"; "-": none
    int8_t dims[8];   ///< exponents of m, kg, s, A, K, mol, cd, rad
} ScriptUnit;

/** Small, for there are many. */
typedef struct ScriptField {
    uint32_t offset; ///< [bytes] from the start of the struct
    uint16_t name;   ///< where it begins in the mission's names
    uint16_t of;     ///< of a FLEDGE_STRUCT, the index of its type, of a FLEDGE_ENUM, of its enumeration
    uint16_t shape[SCRIPT_DIMENSIONS];
    uint8_t type;         ///< FledgeType
    uint8_t group;        ///< ScriptGroup
    uint8_t flags;        ///< SCRIPT_REQUIRED
    uint8_t n_dimensions; ///< 0: a scalar
    uint8_t unit;         ///< the index of its unit
    uint8_t count;        ///< the index of the field with the number of used rows; SCRIPT_NO_FIELD: all
} ScriptField;

/** A type is an object of Python, which makes modules or messages when it is called. */
typedef struct ScriptType {
    const struct _mp_obj_type_t *base; ///< script_class_type
    const char *name;
    const ScriptField *fields; ///< in the order of memory, without those that fill gaps
    uint16_t n;
    uint32_t size;                  ///< [bytes]
    void (*reset)(void *);          ///< of a module, else NULL
    void (*update)(void *, Tick t); ///< of a module, else NULL
} ScriptType;

/** A module of the mission: `f.control`. */
typedef struct ScriptPlace {
    const char *name;
    const ScriptType *type;
    uint32_t offset;     ///< [bytes] in the mission's memory
    uint32_t parameters; ///< [bytes] of the first parameter in the module
    int16_t block;       ///< the index of its parameters in the table of commands; -1: it has none
    uint16_t crc; ///< command_crc of its parameters on the desktop, big-endian: the script must compute the same bits
} ScriptPlace;

/** A wire from outside: carried before the update of the module that reads it. */
typedef struct ScriptInput {
    uint16_t place;      ///< the index of the module that reads it
    uint32_t from, to;   ///< [bytes] in the mission's memory
    uint32_t size;       ///< [bytes]
    int64_t stale_after; ///< [ns]; 0: never
} ScriptInput;

/** A constant of fledge.flight, such as PYRAMID: rows of numbers. */
typedef struct ScriptConstant {
    const char *name;
    const double *numbers;
    uint16_t shape[2];
} ScriptConstant;

extern const struct _mp_obj_type_t script_quantity_type;

/** A quantity, an object of Python: units are such in constant memory. */
typedef struct ScriptQuantity {
    const struct _mp_obj_type_t *type; ///< script_quantity_type
    uint64_t value;                    ///< a number, or nested lists of them
    int8_t dims[8];                    ///< exponents of m, kg, s, A, K, mol, cd, rad
} ScriptQuantity;

/** A name of fledge.units. */
typedef struct ScriptUnitName {
    const char *name;
    ScriptQuantity unit;
} ScriptUnitName;

/** Converts the bits of a number into an object of Python. */
#define SCRIPT_NUMBER(bits) (UINT64_C(bits) + UINT64_C(0x8004000000000000))

/** All of it. Tasks, modes and events have the order of flight.py, by which commands name them. */
typedef struct ScriptMission {
    const char *module;           ///< the frozen module to import: "nadir_spin.flight"
    const char *process;          ///< the name of the flight process: "flight"
    const char *const *processes; ///< those of all processes of the mission, NULL at the end
    int whole;                    ///< 1: the module's build(sim) builds all processes; 0: build(f)
    int computed;                 ///< 1: the module fledge_computed has functions of fledge.world
    const CommandTable *commands; ///< whose blocks have the rules of the parameters
    void *memory;
    uint32_t size;      ///< [bytes] of it
    uint32_t heap_size; ///< [bytes]
    void *heap;         ///< of the interpreter, aligned to 8 bytes
    const char *names;  ///< of all fields, each with its end
    const ScriptUnit *field_units;
    const ScriptEnum *enums;
    const ScriptType *const *types;
    const ScriptPlace *places;
    const ScriptInput *inputs;
    const ScriptConstant *constants;
    const ScriptUnitName *units;
    const ScriptUnit *unit_texts; ///< how compound units are shown
    const char *const *tasks;
    const char *const *modes;
    const char *const *events;
    uint16_t n_types, n_enums, n_places, n_inputs, n_constants, n_units, n_unit_texts, n_tasks, n_modes, n_events;
} ScriptMission;

extern const ScriptMission fledge_script;

static inline const char *script_field_name(const ScriptField *field)
{
    return fledge_script.names + field->name;
}

/** The type of a FLEDGE_STRUCT. */
static inline const ScriptType *script_field_struct(const ScriptField *field)
{
    return fledge_script.types[field->of];
}

/** The enumeration of a FLEDGE_ENUM, or NULL. */
static inline const ScriptEnum *script_field_enum(const ScriptField *field)
{
    return field->type == FLEDGE_ENUM ? &fledge_script.enums[field->of] : NULL;
}

static inline const ScriptUnit *script_field_unit(const ScriptField *field)
{
    return &fledge_script.field_units[field->unit];
}

#ifdef __cplusplus
}
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the files with which a script composes its flight process.
 *
 *     process.c       the process `f`: its modules, their wires, and the run of the script
 *     tasks.c         f.task(), f.mode(), f.start_in(), f.enter()
 *     events.c        f.event()
 *     handles.c       the objects that these return
 *     watch.c         f.watch(port).field < 1: fields that are compared, and conditions of them
 *     composition.c   texts of errors
 *
 * `Process` on the desktop (python/fledge/mission/process.py) accepts and refuses the same. */
#ifndef TARGETS_MICROPYTHON_COMPOSITION_H
#define TARGETS_MICROPYTHON_COMPOSITION_H

#include "targets/micropython/executive.h"
#include "targets/micropython/objects.h"
#include "targets/micropython/script.h"

#include <py/runtime.h>

#define PROCESS fledge_script.process

/* --- texts of errors */

/** A text on the stack. */
typedef struct Text {
    char text[200];
    ScriptText end;
    mp_print_t print;
} Text;

/** Begin a text, for mp_printf. */
const mp_print_t *process_text(Text *text);

/** Raise "the mode x; the process has a, b". list: records that begin with `next` and `name`. */
NORETURN void process_refuse_name(const char *subject, const char *does, const char *name, const void *list);

/** Raise if the mission is composed already. */
void process_check_composing(const char *subject);

/* --- the process */

/** The name of a new mode or event, which must not be that of another thing. */
const char *process_new_name(mp_obj_t given, const char *kind);

/** [ns] A time that must not be negative. */
int64_t process_time(mp_obj_t value, const char *kind, const char *name, const char *key);

/** [bytes] of a field in the mission's memory. */
uint32_t process_offset(const ScriptNode *node);

/** The mode of a handle or name. does: as in "enters the mode". */
ExecutiveMode *process_find_mode(mp_obj_t given, const char *subject, const char *does);

extern const mp_obj_fun_builtin_var_t process_task_obj, process_mode_obj, process_event_obj;
extern const mp_obj_fun_builtin_fixed_t process_start_in_obj, process_enter_obj;

/* --- handles */

typedef struct Handle {
    mp_obj_base_t base;
    mp_obj_t name;
} Handle;

typedef struct TaskHandle {
    Handle handle;
    ExecutiveTask task;
} TaskHandle;

typedef struct ModeHandle {
    Handle handle;
    ExecutiveMode mode;
} ModeHandle;

typedef struct EventHandle {
    Handle handle;
    ExecutiveEvent event;
} EventHandle;

#define HANDLE(Type, member, record) ((Type *)(void *)((char *)(record)-offsetof(Type, member)))

extern const mp_obj_type_t process_task_type, process_mode_type, process_event_type;

/** The name of a handle of a type, or a name itself. */
const char *handle_name(mp_obj_t handle, const mp_obj_type_t *type, const char *subject);

/** The items of a list or tuple, or the single object; None: no items. */
void handle_list(const mp_obj_t *value, size_t *n, const mp_obj_t **items);

/** Request a mode, unless its condition does not hold. */
mp_obj_t handle_enter(ExecutiveMode *mode);

/* --- conditions */

enum { WHOLE = 0xFF }; /* a Watch of a whole field, or of a message */

typedef struct Watch {
    mp_obj_base_t base;
    ScriptNode *node;
    const ScriptField *field; ///< NULL: the node itself
    uint32_t index;           ///< of EXEC_ELEMENT
    uint8_t measure;          ///< ExecMeasure, or WHOLE
} Watch;

extern const mp_obj_type_t watch_type;

mp_obj_t watch_new(ScriptNode *node, const ScriptField *field);
const char *watch_text(Text *text, const Watch *w);

/** Refuse all but numbers. verb: the action, as in "compare". */
void watch_check_number(const Watch *w, const char *verb);

/** The condition that a script gives for a key. */
const ExecutiveCondition *watch_condition(mp_obj_t value, const char *subject, const char *key);

#endif

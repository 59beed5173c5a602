/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/update.h"

#include "targets/micropython/executive.h"
#include "targets/micropython/script.h"

#include <py/runtime.h>

#include <string.h>

typedef struct Update {
    struct Update *next;
    ScriptRoot *module;
    uint8_t *before;   ///< its memory before a call
    char failure[200]; ///< why the last call failed that did
    uint32_t turns;    ///< that a call may take
    uint32_t most_turns;
    uint32_t updates, failures;
    uint32_t reported;      ///< failures up to the last text of telemetry
    uint16_t crc;           ///< of that text
    int64_t longest, total; ///< [ns]
} Update;

static Update *updates;
static const Update *running;
static Tick now; /* of the update that runs */

const ScriptRoot *update_running(void)
{
    return running != NULL ? running->module : NULL;
}

/* --- calls that fail alone ------------------------------------------------------------------------- */

/* The module is as before, its outputs are held. */
static void undo(const Update *u)
{
    uint8_t *memory = u->module->memory;
    const ScriptType *type = u->module->node.type;
    memcpy(memory, u->before, type->size);
    for (uint16_t i = 0u; i < type->n; i++) {
        if (type->fields[i].group == SCRIPT_OUT) {
            Head head;
            memcpy(&head, memory + type->fields[i].offset, sizeof head);
            head = head_held(head);
            memcpy(memory + type->fields[i].offset, &head, sizeof head);
        }
    }
}

/* Store the reason of a failed call, and report it to the ground. */
static void report(Update *u, int64_t t)
{
    const uint16_t crc = command_crc((const uint8_t *)script_error(), (uint32_t)strlen(script_error()));
    (void)strncpy(u->failure, script_error(), sizeof u->failure - 1u);
    if (crc != u->crc || u->failures >= 2u * u->reported) {
        char memory[sizeof u->failure + 100u];
        ScriptText text = {memory, sizeof memory, 0u};
        const mp_print_t print = script_text(&text);
        objects_print_path(&print, &u->module->node);
        mp_printf(&print, ", failure %u: %s", (unsigned)u->failures, u->failure);
        telemetry_text(&executive_texts, t >= 0 ? t : executive.t, TELEMETRY_SCRIPT, 0u, script_error_line(), memory);
        u->crc = crc;
        u->reported = u->failures;
    }
}

/* Call a function of the module's script. */
static void call(Update *u, mp_obj_t function, size_t n, Tick t)
{
    const mp_obj_t arguments[] = {MP_OBJ_FROM_PTR(u->module), mp_obj_new_float(tick_seconds(t.t)),
                                  mp_obj_new_float(tick_seconds(t.dt))};
    memcpy(u->before, u->module->memory, u->module->node.type->size);
    running = u;
    now = t;
    script_limit(u->turns);
    const int failed = script_call(function, n, arguments) == MP_OBJ_NULL;
    const uint32_t turns = u->turns - script_left();
    script_limit(0u);
    running = NULL;
    u->most_turns = turns > u->most_turns ? turns : u->most_turns;
    if (failed) {
        u->failures++;
        undo(u);
        report(u, t.t);
    }
}

static void run_update(void *self, Tick t)
{
    Update *u = self;
    const int64_t start = executive_clock != NULL ? executive_clock() : 0;
    call(u, u->module->update, 3u, t);
    const int64_t time = executive_clock != NULL ? executive_clock() - start : 0;
    u->longest = time > u->longest ? time : u->longest;
    u->total += time;
    u->updates++;
}

static void run_reset(void *self)
{
    Update *u = self;
    u->module->node.type->reset(u->module->memory);
    if (u->module->reset != MP_OBJ_NULL) {
        call(u, u->module->reset, 1u, (Tick){-1, 0});
    }
}

void update_begin(void)
{
    updates = NULL;
    running = NULL;
}

void update_install(ScriptRoot *module)
{
    Update *u = m_new0(Update, 1);
    u->module = module;
    u->before = m_new(uint8_t, module->node.type->size);
    u->turns = module->turns;
    u->next = updates;
    updates = u;
    objects_make_views(&module->node);
    ExecutiveModule *place = &executive.modules[module->place];
    place->reset = run_reset;
    place->update = run_update;
    place->self = u;
}

const char *update_failure(void)
{
    const Update *u = updates;
    while (u != NULL && u->failures == 0u) {
        u = u->next;
    }
    return u != NULL ? u->failure : NULL;
}

/* --- functions for scripts ------------------------------------------------------------------------- */

static uint8_t *output_of(mp_obj_t object, mp_obj_t port, const char *what)
{
    const ScriptRoot *module = MP_OBJ_TO_PTR(object);
    const ScriptNode *node = objects_struct(port);
    const mp_print_t *error = objects_error();
    objects_print_path(error, &module->node);
    if (running == NULL || running->module != module || now.t < 0) {
        mp_printf(error, ".%s() is for its own update in Python, while it runs", what);
        objects_raise();
    }
    if (node == NULL || node->owner != &module->node || objects_field_of(node)->group != SCRIPT_OUT) {
        mp_printf(error, ".%s: expected an output of the module; found ", what);
        objects_print_found(error, port);
        mp_print_str(error, ". It has ");
        objects_print_names(error, module->node.type, SCRIPT_OUT);
        objects_raise();
    }
    return objects_memory(node);
}

static mp_obj_t publish(size_t n, const mp_obj_t *arguments, mp_map_t *keywords)
{
    static const mp_arg_t allowed[] = {{MP_QSTR_quality, MP_ARG_OBJ, {.u_rom_obj = MP_ROM_NONE}}};
    mp_arg_val_t quality;
    mp_arg_parse_all(n - 2u, arguments + 2, keywords, 1, allowed, &quality);
    uint8_t *message = output_of(arguments[0], arguments[1], "publish");
    Head head;
    memcpy(&head, message, sizeof head);
    head = head_next(head, now.t, QUALITY_GOOD);
    memcpy(message, &head, sizeof head);
    if (quality.u_obj != mp_const_none) {
        ScriptNode *output = objects_struct(arguments[1]);
        ScriptNode *view = objects_view(output, objects_field(output->type, "head"), 0u);
        objects_store(view, objects_field(view->type, "quality"), quality.u_obj);
    }
    return mp_const_none;
}
MP_DEFINE_CONST_FUN_OBJ_KW(update_publish_object, 2, publish);

static mp_obj_t held(mp_obj_t object, mp_obj_t port)
{
    uint8_t *message = output_of(object, port, "held");
    Head head;
    memcpy(&head, message, sizeof head);
    head = head_held(head);
    memcpy(message, &head, sizeof head);
    return mp_const_none;
}
MP_DEFINE_CONST_FUN_OBJ_2(update_held_object, held);

/* --- figures --------------------------------------------------------------------------------------- */

void update_figures(void (*line)(const char *text))
{
    for (const Update *u = updates; u != NULL; u = u->next) {
        char memory[sizeof u->failure + 200u];
        ScriptText text = {memory, sizeof memory, 0u};
        const mp_print_t print = script_text(&text);
        mp_print_str(&print, "script.");
        objects_print_path(&print, &u->module->node);
        mp_printf(&print,
                  " %u updates of the script, %u calls failed; at most %u of %u turns; longest %lld ns, all %lld ns",
                  (unsigned)u->updates, (unsigned)u->failures, (unsigned)u->most_turns, (unsigned)u->turns,
                  (long long)u->longest, (long long)u->total);
        line(memory);
        if (u->failures > 0u) {
            (void)script_text(&text);
            mp_print_str(&print, "script.");
            objects_print_path(&print, &u->module->node);
            mp_printf(&print, ".failure %s", u->failure);
            line(memory);
        }
    }
}

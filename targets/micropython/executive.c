/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/executive.h"

#include "targets/micropython/arena.h"
#include "targets/micropython/procedure.h"

#include <string.h>

Executive executive;
int64_t (*executive_clock)(void);

static uint8_t texts[2048];
TelemetryTexts executive_texts = {texts, sizeof texts, 0u, 0u};

/* --- texts ----------------------------------------------------------------------------------------- */

/* One line, cut to its size. */
static struct {
    char text[256];
    uint32_t n;
} line;

static void put(const char *text)
{
    while (*text != '\0' && line.n + 1u < sizeof line.text) {
        line.text[line.n++] = *text++;
    }
    line.text[line.n] = '\0';
}

/* A line begins with its first word. */
static void start(const char *word)
{
    line.n = 0u;
    put(word);
}

static void put_number(int64_t x)
{
    char digits[21];
    uint32_t i = sizeof digits - 1u;
    uint64_t rest = x < 0 ? 0u - (uint64_t)x : (uint64_t)x;
    digits[i] = '\0';
    do {
        digits[--i] = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest > 0u);
    put(x < 0 ? "-" : "");
    put(&digits[i]);
}

static void put_hex(uint32_t digit)
{
    const char text[2] = {"0123456789abcdef"[digit & 15u], '\0'};
    put(text);
}

static void put_bytes(const uint8_t *bytes, uint32_t n)
{
    for (uint32_t i = 0u; i < n; i++) {
        put_hex((uint32_t)bytes[i] >> 4);
        put_hex(bytes[i]);
    }
}

/* --- lists ----------------------------------------------------------------------------------------- */

static uint8_t *at(uint32_t offset)
{
    return (uint8_t *)fledge_script.memory + offset;
}

int executive_place(uint32_t offset)
{
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        const ScriptPlace *place = &fledge_script.places[i];
        if (offset >= place->offset && offset - place->offset < place->type->size) {
            return i;
        }
    }
    return -1;
}

static ExecutiveModule *module_at(uint32_t offset)
{
    return &executive.modules[executive_place(offset)];
}

ExecutiveTask *executive_find_task(const char *name)
{
    ExecutiveTask *task = executive.tasks;
    while (task != NULL && strcmp(task->name, name) != 0) {
        task = task->next;
    }
    return task;
}

ExecutiveMode *executive_find_mode(const char *name)
{
    ExecutiveMode *mode = executive.modes;
    while (mode != NULL && strcmp(mode->name, name) != 0) {
        mode = mode->next;
    }
    return mode;
}

ExecutiveEvent *executive_find_event(const char *name)
{
    ExecutiveEvent *event = executive.events;
    while (event != NULL && strcmp(event->name, name) != 0) {
        event = event->next;
    }
    return event;
}

static int has_mode(ExecutiveMode *const *modes, uint16_t n, const ExecutiveMode *mode)
{
    for (uint16_t i = 0u; i < n; i++) {
        if (modes[i] == mode) {
            return 1;
        }
    }
    return 0;
}

static int runs_in(const ExecutiveTask *task, const ExecutiveMode *mode)
{
    for (uint16_t i = 0u; task->named && mode != NULL && i < mode->n; i++) {
        if (mode->tasks[i] == task) {
            return 1;
        }
    }
    return !task->named;
}

/* --- composing ------------------------------------------------------------------------------------- */

int executive_begin(void)
{
    executive = (Executive){0};
    /* The wires come first, because they need the larger alignment. */
    const size_t wires = fledge_script.n_inputs * sizeof(ExecutiveWire);
    uint8_t *block = arena_take(wires + fledge_script.n_places * sizeof(ExecutiveModule));
    executive.inputs = (ExecutiveWire *)(void *)block;
    executive.modules = block != NULL ? (ExecutiveModule *)(void *)(block + wires) : NULL;
    return block != NULL;
}

void executive_name(uint16_t place)
{
    const ScriptPlace *p = &fledge_script.places[place];
    executive.modules[place] = (ExecutiveModule){.reset = p->type->reset, .update = p->type->update, .named = 1u};
    executive.modules[place].self = at(p->offset);
}

void executive_add_wire(ExecutiveWire *wire)
{
    wire->next = executive.wires;
    executive.wires = wire;
}

void executive_add_task(ExecutiveTask *task)
{
    ExecutiveTask **link = &executive.tasks;
    while (*link != NULL && (*link)->priority >= task->priority) {
        link = &(*link)->next;
    }
    task->next = *link;
    *link = task;
    for (uint16_t i = 0u; i < task->n; i++) {
        executive.modules[task->run[i]].scheduled = 1u;
    }
}

void executive_add_mode(ExecutiveMode *mode)
{
    ExecutiveMode **link = &executive.modes;
    while (*link != NULL) {
        link = &(*link)->next;
    }
    *link = mode;
    executive.initial = executive.initial != NULL ? executive.initial : mode;
    for (uint16_t i = 0u; i < mode->n; i++) {
        mode->tasks[i]->named = 1u;
    }
}

void executive_add_event(ExecutiveEvent *event)
{
    ExecutiveEvent **link = &executive.events;
    while (*link != NULL) {
        link = &(*link)->next;
    }
    *link = event;
}

void *executive_parameters(uint16_t block)
{
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        const ScriptPlace *place = &fledge_script.places[i];
        if (place->block == (int)block) {
            return at(place->offset + place->parameters);
        }
    }
    return NULL;
}

/* A wire belongs to the configuration that it comes from, which does not age, or else to the module that reads it. */
static void link_wire(ExecutiveWire *wire)
{
    const int from = executive_place(wire->from); /* -1: an input of the mission */
    ExecutiveModule *owner = module_at(wire->to);
    if (from >= 0 && !executive.modules[from].scheduled) {
        owner = &executive.modules[from];
        wire->stale_after = 0;
    }
    wire->next = owner->wires;
    owner->wires = wire;
}

static void link_wires(void)
{
    for (ExecutiveWire *wire = executive.wires, *next; wire != NULL; wire = next) {
        next = wire->next;
        link_wire(wire);
    }
    for (uint16_t i = 0u; i < fledge_script.n_inputs; i++) {
        const ScriptInput *in = &fledge_script.inputs[i];
        executive.inputs[i] =
            (ExecutiveWire){.from = in->from, .to = in->to, .size = in->size, .stale_after = in->stale_after};
        link_wire(&executive.inputs[i]);
    }
}

/* "flight.NAME" and a text: of an error. */
static const char *wrong(const char *before, const char *name, const char *after)
{
    start(before);
    put(fledge_script.process);
    put(".");
    put(name);
    put(after);
    return line.text;
}

static const char *check(void)
{
    static const char *const anew = ", unlike the mission as it was exported: export it again";
    const ExecutiveMode *mode = executive.modes;
    const ExecutiveEvent *event = executive.events;
    uint16_t n_tasks = 0u;
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        const ScriptPlace *place = &fledge_script.places[i];
        if (!executive.modules[i].named) {
            return wrong("the script does not make ", place->name, anew);
        }
        for (uint16_t k = 0u; !executive.modules[i].scheduled && k < place->type->n; k++) {
            if (place->type->fields[k].group == SCRIPT_IN) {
                return wrong("", place->name, " is in no task");
            }
        }
    }
    for (const ExecutiveWire *wire = executive.wires; wire != NULL; wire = wire->next) {
        const ExecutiveModule *from = module_at(wire->from);
        if (wire->by != EXEC_SOLE && !from->scheduled) {
            return wrong("the script has inputs that choose an output of ",
                         fledge_script.places[from - executive.modules].name, ", which is in no task");
        }
        if (wire->mode != NULL && executive_find_mode(wire->mode) == NULL) {
            return wrong("the script has a wire for the mode ", wire->mode, ", which is not there");
        }
    }
    for (const ExecutiveTask *task = executive.tasks; task != NULL; task = task->next) {
        n_tasks++;
    }
    for (uint16_t i = 0u; i < fledge_script.n_tasks; i++) {
        if (executive_find_task(fledge_script.tasks[i]) == NULL || n_tasks != fledge_script.n_tasks) {
            return wrong("the script makes other tasks than ", fledge_script.tasks[i], anew);
        }
    }
    for (uint16_t i = 0u; i < fledge_script.n_modes || mode != NULL; i++, mode = mode->next) {
        if (i == fledge_script.n_modes || mode == NULL || strcmp(mode->name, fledge_script.modes[i]) != 0) {
            return wrong("the script does not make, at its place, the mode ",
                         mode == NULL ? fledge_script.modes[i] : mode->name, anew);
        }
    }
    for (uint16_t i = 0u; i < fledge_script.n_events || event != NULL; i++, event = event->next) {
        if (i == fledge_script.n_events || event == NULL || strcmp(event->name, fledge_script.events[i]) != 0) {
            return wrong("the script does not make, at its place, the event ",
                         event == NULL ? fledge_script.events[i] : event->name, anew);
        }
        for (ExecutiveArm *arm = event->arms; arm != NULL; arm = arm->next) {
            arm->event = executive_find_event(arm->name);
            if (arm->event == NULL) {
                (void)wrong("event ", event->name, arm->on ? " arms " : " disarms ");
                put(arm->name);
                put(", which is not there");
                return line.text;
            }
        }
    }
    return NULL;
}

/* Whether the parameters of a place are those that the desktop has computed. */
static int differs(const ScriptPlace *place)
{
    const CommandTable *commands = fledge_script.commands;
    if (place->block < 0) {
        return 0;
    }
    const CommandBlock *block = &commands->blocks[place->block];
    memcpy(commands->staged, executive_parameters((uint16_t)place->block), block->size);
    if (exec_little_endian()) {
        exec_reverse(block->runs, block->n_runs, commands->staged, 0u, block->size);
    }
    return command_crc(commands->staged, block->size) != place->crc;
}

/* --- running --------------------------------------------------------------------------------------- */

static int takes(const ExecutiveWire *wire, int64_t t)
{
    if (wire->by == EXEC_IN_MODE) {
        return executive.current != NULL && strcmp(wire->mode, executive.current->name) == 0;
    }
    Head held, next;
    memcpy(&held, at(wire->to), sizeof held);
    memcpy(&next, at(wire->from), sizeof next);
    return wire->before == 0u || exec_takes((ExecChoice)wire->by, held, next, t, wire->stale_after);
}

static void carry(const ExecutiveWire *wire, int64_t t)
{
    uint8_t *to = at(wire->to);
    if (wire->by == EXEC_SOLE || takes(wire, t)) {
        memcpy(to, at(wire->from), wire->size);
    }
    if (wire->stale_after != 0) {
        Head head;
        memcpy(&head, to, sizeof head);
        exec_age(&head, t, wire->stale_after);
        memcpy(to, &head, sizeof head);
    }
}

static void publish(ExecutiveModule *module, int64_t t)
{
    module->changed = 0u;
    module->update(module->self, (Tick){t, 0});
    for (const ExecutiveWire *wire = module->wires; wire != NULL; wire = wire->next) {
        carry(wire, t);
    }
}

static void run(ExecutiveTask *task, int64_t t)
{
    const Tick tick = exec_begin(&task->state, task->rate, t);
    for (uint16_t i = 0u; i < task->n; i++) {
        const ExecutiveModule *module = &executive.modules[task->run[i]];
        for (const ExecutiveWire *wire = module->wires; wire != NULL; wire = wire->next) {
            carry(wire, t);
        }
        module->update(module->self, tick);
    }
}

void executive_restart(int64_t t)
{
    procedure_end();
    if (executive.modules == NULL) {
        return;
    }
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        for (const ExecutiveWire *wire = executive.modules[i].wires; wire != NULL; wire = wire->next) {
            memset(at(wire->to), 0, wire->size);
            if (executive_place(wire->from) < 0) {
                memset(at(wire->from), 0, wire->size); /* of the mission's inputs */
            }
        }
    }
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        executive.modules[i].reset(executive.modules[i].self);
    }
    executive.current = executive.requested = executive.initial;
    executive.t = -1;
    for (ExecutiveEvent *event = executive.events; event != NULL; event = event->next) {
        event->state = event->armed ? exec_armed() : exec_disarmed();
    }
    for (ExecutiveTask *task = executive.tasks; task != NULL; task = task->next) {
        task->state = exec_start(task->rate, runs_in(task, executive.initial), t);
    }
    executive.changed = 0u;
    for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
        if (!executive.modules[i].scheduled) {
            publish(&executive.modules[i], t);
        }
    }
}

/* A task that becomes active is reset, and runs on its own grid of times. */
static void enter_mode(int64_t t)
{
    executive.current = executive.requested;
    for (ExecutiveTask *task = executive.tasks; task != NULL; task = task->next) {
        if (exec_switch(&task->state, runs_in(task, executive.current), task->rate, t)) {
            for (uint16_t i = 0u; i < task->n; i++) {
                executive.modules[task->run[i]].reset(executive.modules[task->run[i]].self);
            }
        }
    }
}

static ExecOperand operand(const ExecutiveOperand *o)
{
    return (ExecOperand){o->constant ? (const void *)&o->of : at(o->of.field.offset),
                         o->constant ? 1u : o->of.field.elements, (FledgeType)o->type, (ExecMeasure)o->measure};
}

/* The results that wait, after a condition. */
static uint64_t results_after(uint64_t results, const ExecutiveCondition *c)
{
    if (c->join == EXEC_COMPARE) {
        const ExecOperand left = operand(&c->of.operands[0]), right = operand(&c->of.operands[1]);
        return exec_join(results, EXEC_COMPARE, exec_compare(&left, (ExecRelation)c->relation, &right));
    }
    results = results_after(results, c->of.parts[0]);
    if (c->join != EXEC_INVERSE) {
        results = results_after(results, c->of.parts[1]);
    }
    return exec_join(results, (ExecJoin)c->join, 0);
}

static int holds(const ExecutiveCondition *condition)
{
    return (int)(results_after(0u, condition) & 1u);
}

int executive_admits(const ExecutiveMode *mode)
{
    int admits = mode->n_after == 0u;
    for (uint16_t i = 0u; executive.current != NULL && i < mode->n_after; i++) {
        admits |= strcmp(mode->after[i], executive.current->name) == 0;
    }
    return admits && (mode->when == NULL || holds(mode->when));
}

static int sets(const ExecutiveEvent *event, uint16_t place)
{
    const ExecutiveSetting *setting = event->settings;
    while (setting != NULL && executive_place(setting->offset) != (int)place) {
        setting = setting->next;
    }
    return setting != NULL;
}

static void check_event(ExecutiveEvent *event, int64_t t)
{
    const int watches = event->n_modes == 0u || has_mode(event->modes, event->n_modes, executive.current);
    const int held = watches && holds(event->when);
    const int again = event->until != NULL ? holds(event->until) : !held;
    if (!exec_fires(&event->state, held, again, event->hold, event->count, event->once, t)) {
        return;
    }
    event->state.refused = event->enter != NULL && !executive_admits(event->enter);
    if (event->enter != NULL && !event->state.refused) {
        executive.requested = event->enter;
    }
    for (const ExecutiveArm *arm = event->arms; arm != NULL; arm = arm->next) {
        arm->event->state.armed = arm->on;
    }
    for (const ExecutiveSetting *setting = event->settings; setting != NULL; setting = setting->next) {
        memcpy(at(setting->offset), setting->bytes, setting->n);
    }
    for (uint16_t i = 0u; event->settings != NULL && i < fledge_script.n_places; i++) {
        if (!executive.modules[i].scheduled && sets(event, i)) {
            publish(&executive.modules[i], t);
        }
    }
}

void executive_tick(int64_t t)
{
    int ran = 0;
    for (uint16_t i = 0u; executive.changed && i < fledge_script.n_places; i++) {
        if (executive.modules[i].changed) {
            publish(&executive.modules[i], t);
        }
    }
    executive.changed = 0u;
    if (executive.requested != executive.current) {
        enter_mode(t);
    }
    for (ExecutiveTask *task = executive.tasks; task != NULL; task = task->next) {
        if (exec_due(&task->state, t)) {
            run(task, t);
            ran = 1;
        }
    }
    executive.t = t;
    for (ExecutiveEvent *event = executive.events; ran && event != NULL; event = event->next) {
        check_event(event, t);
    }
    if (ran) {
        procedure_run(t);
    }
}

int64_t executive_next(void)
{
    int64_t t = INT64_MAX;
    for (const ExecutiveTask *task = executive.tasks; task != NULL; task = task->next) {
        t = exec_sooner(t, exec_next(&task->state, task->rate, runs_in(task, executive.requested), executive.t));
    }
    return t;
}

static ExecutiveMode *mode_at(uint16_t i)
{
    ExecutiveMode *mode = executive.modes;
    for (; mode != NULL && i > 0u; i--) {
        mode = mode->next;
    }
    return mode;
}

void executive_start_in(uint16_t mode)
{
    executive.initial = mode_at(mode);
}

void executive_enter(uint16_t mode)
{
    ExecutiveMode *entered = mode_at(mode);
    if (entered != NULL) {
        executive_request(entered);
    }
}

int executive_may_enter(uint16_t mode)
{
    const ExecutiveMode *entered = mode_at(mode);
    return entered == NULL || executive_admits(entered);
}

void executive_request(ExecutiveMode *mode)
{
    executive.requested = mode;
}

uint16_t executive_mode(void)
{
    uint16_t i = 0u;
    for (const ExecutiveMode *mode = executive.modes; mode != NULL && mode != executive.current; mode = mode->next) {
        i++;
    }
    return i;
}

void executive_publish(uint16_t block, int64_t t)
{
    for (uint16_t i = 0u; executive.modules != NULL && i < fledge_script.n_places; i++) {
        if (fledge_script.places[i].block == (int)block && !executive.modules[i].scheduled) {
            publish(&executive.modules[i], t);
        }
    }
}

static ExecutiveEvent *event_at(uint16_t i)
{
    ExecutiveEvent *event = executive.events;
    for (; event != NULL && i > 0u; i--) {
        event = event->next;
    }
    return event;
}

void executive_arm(uint16_t event, int on)
{
    ExecutiveEvent *armed = event_at(event);
    if (armed != NULL) {
        armed->state.armed = on;
    }
}

const ExecEvent *executive_event(uint16_t event)
{
    static const ExecEvent none = {-1, -1, 0, 0, 0, 0};
    const ExecutiveEvent *entry = event_at(event);
    return entry != NULL ? &entry->state : &none;
}

void executive_changed(uint16_t place)
{
    if (executive.composed && executive.modules != NULL && !executive.modules[place].scheduled) {
        executive.modules[place].changed = executive.changed = 1u;
    }
}

/* --- init ------------------------------------------------------------------------------------------ */

static char failure[sizeof line.text]; /* "": none */

const char *executive_failure(void)
{
    return failure[0] != '\0' ? failure : NULL;
}

static void fail(const char *why)
{
    const size_t n = why == NULL ? 0u : strlen(why) < sizeof failure ? strlen(why) : sizeof failure - 1u;
    memcpy(failure, why == NULL ? "" : why, n);
    failure[n] = '\0';
    if (n > 0u) {
        executive = (Executive){0};
    }
}

void executive_init(void)
{
    procedure_forget();
    memset(fledge_script.memory, 0, fledge_script.size);
    executive = (Executive){0};
    const char *why = process_run();
    if (why == NULL) {
        why = check();
    }
    fail(why);
    if (why == NULL) {
        link_wires();
        for (uint16_t i = 0u; i < fledge_script.n_places; i++) {
            executive.modules[i].differs = (uint8_t)differs(&fledge_script.places[i]);
            if (executive.modules[i].differs) {
                telemetry_text(
                    &executive_texts, -1, TELEMETRY_SCRIPT, 0u, 0u,
                    wrong("", fledge_script.places[i].name, ": its parameters are not those of the desktop"));
            }
        }
    }
    executive.composed = 1u;
    arena_in_use->locked = 1;
    executive_restart(0);
    if (why == NULL) {
        fail(update_failure()); /* of a reset of the script's */
    }
}

void executive_figures(void (*sink)(const char *text))
{
    update_figures(sink);
}

/* --- describing ------------------------------------------------------------------------------------ */

typedef void (*Sink)(const char *text);

/* Words of a line. */
static void put_word(const char *word)
{
    put(" ");
    put(word);
}

static void put_word_number(int64_t x)
{
    put(" ");
    put_number(x);
}

/* MODULE+OFFSET */
static void put_place(uint32_t offset)
{
    const ScriptPlace *place = &fledge_script.places[executive_place(offset)];
    put_word(place->name);
    put("+");
    put_number((int64_t)offset - place->offset);
}

/* MODULE.PORT */
static void put_port(uint32_t offset)
{
    const ScriptPlace *place = &fledge_script.places[executive_place(offset)];
    put_word(place->name);
    put(".");
    for (uint16_t i = 0u; i < place->type->n; i++) {
        if (place->type->fields[i].offset == offset - place->offset) {
            put(script_field_name(&place->type->fields[i]));
        }
    }
}

static void two_words(Sink sink, const char *word, const char *a, const char *b)
{
    start(word);
    put_word(a);
    put_word(b);
    sink(line.text);
}

static void describe_module(Sink sink, uint16_t i)
{
    enum { ROW = 32 };
    static const uint8_t zeros[ROW];
    static const char *const choices[] = {"", "newest", "first", "best", "in"};
    const ScriptPlace *place = &fledge_script.places[i];
    two_words(sink, "module", place->name, place->type->name);
    if (executive.modules[i].update != place->type->update) {
        start("python");
        put_word(place->name);
        sink(line.text);
    }
    for (uint32_t k = 0u; k < place->type->size; k += ROW) {
        const uint32_t n = place->type->size - k < ROW ? place->type->size - k : ROW;
        if (memcmp(at(place->offset + k), zeros, n) != 0) {
            start("bytes");
            put_word(place->name);
            put_word_number(k);
            put(" ");
            put_bytes(at(place->offset + k), n);
            sink(line.text);
        }
    }
    if (executive.modules[i].differs) {
        start("differs");
        put_word(place->name);
        sink(line.text);
    }
    for (const ExecutiveWire *wire = executive.modules[i].wires; wire != NULL; wire = wire->next) {
        if (executive_place(wire->from) >= 0) {
            start("wire");
            put_port(wire->from);
            put_port(wire->to);
            put_word_number(wire->stale_after);
            if (wire->by != EXEC_SOLE) {
                put_word(choices[wire->by]);
                if (wire->mode != NULL) {
                    put_word(wire->mode);
                }
                put_word_number(wire->before);
            }
            sink(line.text);
        }
    }
}

static void put_operand(const ExecutiveOperand *o)
{
    static const char *const measures[] = {":element", ":norm", ":max_abs"};
    if (!o->constant) {
        put_place(o->of.field.offset);
        put(measures[o->measure]);
    } else if (o->type == FLEDGE_F64) {
        uint64_t bits;
        memcpy(&bits, &o->of.real, sizeof bits);
        put(" 0x");
        for (int shift = 60; shift >= 0; shift -= 4) {
            put_hex((uint32_t)(bits >> shift));
        }
    } else {
        put_word_number(o->of.whole);
    }
}

static void describe_condition(Sink sink, const char *word, const char *name, const ExecutiveCondition *c)
{
    static const char *const relations[] = {"<", "<=", ">", ">=", "==", "!="};
    static const char *const joins[] = {"", "&", "|", "~"};
    if (c->join == EXEC_COMPARE) {
        start(word);
        put_word(name);
        put_operand(&c->of.operands[0]);
        put_word(relations[c->relation]);
        put_operand(&c->of.operands[1]);
        sink(line.text);
        return;
    }
    for (int i = 0; i < (c->join == EXEC_INVERSE ? 1 : 2); i++) {
        describe_condition(sink, word, name, c->of.parts[i]);
    }
    two_words(sink, word, name, joins[c->join]);
}

static void describe_event(Sink sink, const ExecutiveEvent *event)
{
    start("event");
    put_word(event->name);
    put_word_number(event->hold);
    put_word_number(event->count);
    put_word_number(event->once);
    put_word_number(event->armed);
    sink(line.text);
    for (uint16_t i = 0u; i < event->n_modes; i++) {
        two_words(sink, "looks", event->name, event->modes[i]->name);
    }
    if (event->enter != NULL) {
        two_words(sink, "enters", event->name, event->enter->name);
    }
    for (const ExecutiveArm *arm = event->arms; arm != NULL; arm = arm->next) {
        two_words(sink, arm->on ? "arms" : "disarms", event->name, arm->name);
    }
    for (const ExecutiveSetting *setting = event->settings; setting != NULL; setting = setting->next) {
        for (uint32_t k = 0u; k < setting->n; k += 32u) {
            start("sets");
            put_word(event->name);
            put_place(setting->offset + k);
            put(" ");
            put_bytes(setting->bytes + k, setting->n - k < 32u ? setting->n - k : 32u);
            sink(line.text);
        }
    }
    describe_condition(sink, "when", event->name, event->when);
    if (event->until != NULL) {
        describe_condition(sink, "until", event->name, event->until);
    }
}

void executive_describe(void (*sink)(const char *text))
{
    for (uint16_t i = 0u; executive.modules != NULL && i < fledge_script.n_places; i++) {
        describe_module(sink, i);
    }
    for (const ExecutiveTask *task = executive.tasks; task != NULL; task = task->next) {
        start("task");
        put_word(task->name);
        put_word_number(task->rate.period);
        put_word_number(task->rate.offset);
        put_word_number(task->priority);
        sink(line.text);
        for (uint16_t i = 0u; i < task->n; i++) {
            two_words(sink, "runs", task->name, fledge_script.places[task->run[i]].name);
        }
    }
    for (const ExecutiveMode *mode = executive.modes; mode != NULL; mode = mode->next) {
        start("mode");
        put_word(mode->name);
        sink(line.text);
        for (uint16_t i = 0u; i < mode->n; i++) {
            two_words(sink, "activates", mode->name, mode->tasks[i]->name);
        }
        for (uint16_t i = 0u; i < mode->n_after; i++) {
            two_words(sink, "follows", mode->name, mode->after[i]);
        }
        if (mode->when != NULL) {
            describe_condition(sink, "guards", mode->name, mode->when);
        }
    }
    if (executive.initial != NULL) {
        start("start");
        put_word(executive.initial->name);
        sink(line.text);
    }
    for (const ExecutiveEvent *event = executive.events; event != NULL; event = event->next) {
        describe_event(sink, event);
    }
    if (executive.reset != 0u) {
        start("reset");
        put_place(executive.reset);
        put_word_number(executive.down);
        sink(line.text);
    }
    start("heap");
    put_word_number((int64_t)arena_in_use->used);
    put_word_number((int64_t)arena_in_use->peak);
    put_word_number((int64_t)arena_in_use->size);
    sink(line.text);
}

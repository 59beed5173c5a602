/* SPDX-License-Identifier: Apache-2.0 */
#include "fmi/fmu/fmu.h"

#include "flight/msg/head.h"

#include <float.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const categories[] = {"modes", "events", "commands", "console", "warnings", "errors"};
enum { N_CATEGORIES = sizeof categories / sizeof categories[0], LINE = 1000 };

static uint32_t category_of(const char *name)
{
    uint32_t i = 0u;
    while (i < (uint32_t)N_CATEGORIES && strcmp(name, categories[i]) != 0) {
        ++i;
    }
    return i;
}

/* '#' stands before a reference in the importer's text, and '%' before an argument in that of 2.0. */
static void deliver(const Fmu *f, FmuStatus status, const char *category, const char *text)
{
    char line[2 * LINE + 1];
    size_t n = 0u;
    for (; *text != '\0' && n + 2u < sizeof line; ++text) {
        line[n++] = *text;
        if (*text == '#' || (*text == '%' && f->version == 2)) {
            line[n++] = *text;
        }
    }
    line[n] = '\0';
    if (f->logger != NULL) {
        f->deliver(f, status, category, line);
    }
}

static void log_line(void *user, FmuSeverity severity, const char *category, const char *text)
{
    static const FmuStatus statuses[] = {FMU_DONE, FMU_WARNED, FMU_FAILED};
    const Fmu *f = user;
    const uint32_t i = category_of(category);
    if (i < (uint32_t)N_CATEGORIES && (f->categories >> i & 1u) != 0u) {
        deliver(f, statuses[severity], category, text);
    }
}

FmuStatus fmu_refuse(Fmu *f, FmuStatus status, const char *function, const char *format, ...)
{
    const char *category = status == FMU_FAILED ? "errors" : "warnings";
    char text[LINE];
    va_list arguments;
    if (f == NULL) {
        return FMU_FAILED;
    }
    if (status == FMU_FAILED && f->moment != NULL) {
        f->moment->phase = FMU_TERMINATED;
    }
    if ((f->categories >> category_of(category) & 1u) != 0u) {
        const int n = snprintf(text, sizeof text, "%s: ", function);
        va_start(arguments, format);
        (void)vsnprintf(text + n, sizeof text - (size_t)n, format, arguments);
        va_end(arguments);
        deliver(f, status, category, text);
    }
    return status;
}

int fmu_may(Fmu *f, const char *function, uint32_t phases)
{
    static const char *const names[] = {"Instantiated", "Initialization Mode", "Step Mode", "Event Mode", "Terminated"};
    uint32_t i = 0u;
    if (f == NULL) {
        return 0;
    }
    if ((f->moment->phase & phases) != 0u) {
        return 1;
    }
    while ((f->moment->phase >> i & 1u) == 0u) {
        ++i;
    }
    (void)fmu_refuse(f, FMU_FAILED, function, "the standard forbids this call in the state %s", names[i]);
    return 0;
}

FmuStatus fmu_log_categories(Fmu *f, const char *function, int on, size_t n, const char *const *names)
{
    uint32_t chosen = n == 0u ? UINT32_MAX : 0u;
    size_t i;
    if (!fmu_may(f, function, FMU_ANY)) {
        return FMU_FAILED;
    }
    for (i = 0u; i < n; ++i) {
        const uint32_t category = category_of(names[i]);
        if (category == (uint32_t)N_CATEGORIES) {
            return fmu_refuse(f, FMU_FAILED, function, "there is no log category \"%s\"", names[i]);
        }
        chosen |= 1u << category;
    }
    f->categories = on ? f->categories | chosen : f->categories & ~chosen;
    return FMU_DONE;
}

/* ---- an instance */

/* The memory of the moment, all zero. The journal can have every parameter once. */
static int make_moment(Fmu *f)
{
    const FmuLayout *l = f->layout;
    const size_t n_counts = (size_t)l->n_processes + l->n_events;
    size_t journal = 0u;
    uint32_t i;
    for (i = 0u; i < l->n; ++i) {
        const FmuVariable *v = &l->variables[i];
        if (v->role == FMU_PARAMETER || v->role == FMU_FIXED) {
            journal += sizeof i + (size_t)v->n * element_size(v->type);
        }
    }
    f->moment_size = sizeof *f->moment + n_counts * sizeof *f->seen + 2u * l->n_processes * sizeof *f->request +
                     l->n_messages + journal;
    f->moment = calloc(1u, f->moment_size);
    if (f->moment == NULL) {
        return 0;
    }
    f->moment->phase = FMU_INSTANTIATED;
    f->seen = (uint32_t *)(f->moment + 1);
    f->request = (int32_t *)(f->seen + n_counts);
    f->entered = f->request + l->n_processes;
    f->inputs = (uint8_t *)(f->entered + l->n_processes);
    f->journal = f->inputs + l->n_messages;
    return 1;
}

static int make_system(Fmu *f)
{
    f->system = fmu_system.create(&f->host);
    if (f->system == NULL) {
        return 0;
    }
    f->layout = fmu_system.layout(f->system);
    return 1;
}

static const char *copied(char **memory, const char *text, size_t n)
{
    char *copy = memcpy(*memory, text, n);
    copy[n] = '\0';
    *memory += n + 1u;
    return copy;
}

/* Whether the importer has the model description of this library. */
static int check_token(Fmu *f, const char *function)
{
    char place[LINE], text[64];
    const char *token = fmu_system.token;
    if (token == NULL) {
        FILE *file;
        (void)snprintf(place, sizeof place, "%s/token.txt", f->host.resources);
        file = fopen(place, "r");
        token = file != NULL && fscanf(file, "%63s", text) == 1 ? text : NULL;
        if (file != NULL) {
            (void)fclose(file);
        }
        if (token == NULL) {
            (void)fmu_refuse(f, FMU_FAILED, function, "%s is not there: unpack the FMU with its resources", place);
            return 0;
        }
    }
    if (strcmp(f->host.token, token) != 0) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the model description has the token \"%s\", this library \"%s\"",
                         f->host.token, token);
        return 0;
    }
    return 1;
}

Fmu *fmu_new(const FmuSetup *setup)
{
    const char *name = setup->name != NULL ? setup->name : "";
    const char *token = setup->token != NULL ? setup->token : "";
    const char *resources = setup->resources != NULL ? setup->resources : "";
    size_t n = strlen(resources);
    Fmu *f = calloc(1u, sizeof *f + strlen(name) + strlen(token) + n + 3u);
    const char *const function = setup->version == 2 ? "fmi2Instantiate" : "fmi3InstantiateCoSimulation";
    char *memory;
    if (f == NULL) {
        return NULL;
    }
    memory = (char *)(f + 1);
    n -= n > 1u && (resources[n - 1u] == '/' || resources[n - 1u] == '\\');
    f->host = (FmuHost){f, log_line, copied(&memory, name, strlen(name)), copied(&memory, token, strlen(token)),
                        copied(&memory, resources, n)};
    f->deliver = setup->deliver;
    f->logger = setup->logger;
    f->environment = setup->environment;
    f->version = setup->version;
    f->event_mode = setup->event_mode;
    f->early_return = setup->early_return;
    /* Why there is no instance is always of interest. */
    f->categories = setup->logging ? UINT32_MAX : 1u << category_of("errors");
    if (name[strspn(name, " \t\r\n")] == '\0') {
        (void)fmu_refuse(f, FMU_FAILED, function, "the instance has no name");
    } else if (check_token(f, function) && make_system(f)) {
        if (make_moment(f)) {
            f->categories = setup->logging ? UINT32_MAX : 0u;
            return f;
        }
        (void)fmu_refuse(f, FMU_FAILED, function, "there is no memory left");
    }
    fmu_free(f);
    return NULL;
}

void fmu_free(Fmu *f)
{
    if (f != NULL) {
        if (f->system != NULL) {
            fmu_system.destroy(f->system);
        }
        free(f->moment);
        free(f);
    }
}

FmuStatus fmu_reset(Fmu *f, const char *function)
{
    void *old;
    if (!fmu_may(f, function, FMU_ANY)) {
        return FMU_FAILED;
    }
    old = f->system;
    if (!make_system(f)) {
        f->system = old;
        return fmu_refuse(f, FMU_FAILED, function, "the FMU cannot begin anew");
    }
    fmu_system.destroy(old);
    memset(f->moment, 0, f->moment_size);
    f->moment->phase = FMU_INSTANTIATED;
    f->begun = 0;
    return FMU_DONE;
}

/* ---- what the importer has set, before the system runs */

typedef struct Entry {
    const FmuVariable *variable;
    uint8_t *old;
    uint32_t size; /* [bytes] of `old` */
} Entry;

/* The entry at a place of the journal, which then is behind it; 0: there is no more. */
static int next_entry(const Fmu *f, uint32_t *at, Entry *e)
{
    uint32_t variable;
    *e = (Entry){NULL, NULL, 0u};
    if (*at == f->moment->journal) {
        return 0;
    }
    memcpy(&variable, f->journal + *at, sizeof variable);
    e->variable = &f->layout->variables[variable];
    e->old = f->journal + *at + sizeof variable;
    e->size = e->variable->n * element_size(e->variable->type);
    *at += (uint32_t)sizeof variable + e->size;
    return 1;
}

void fmu_remember(Fmu *f, const FmuVariable *v)
{
    const uint32_t variable = (uint32_t)(v - f->layout->variables);
    uint32_t at = 0u;
    Entry e;
    while (next_entry(f, &at, &e)) {
        if (e.variable == v) {
            return;
        }
    }
    memcpy(f->journal + at, &variable, sizeof variable);
    f->moment->journal += (uint32_t)sizeof variable + v->n * element_size(v->type);
    (void)next_entry(f, &at, &e);
    memcpy(e.old, (const uint8_t *)fmu_system.memory(f->system, v->block) + v->offset, e.size);
}

/* Call changed() of each block of the journal, up to the first that is refused. */
static int check_blocks(Fmu *f)
{
    uint32_t at = 0u;
    Entry e;
    while (next_entry(f, &at, &e)) {
        uint32_t before = 0u;
        Entry first = e;
        while (next_entry(f, &before, &first) && first.variable->block != e.variable->block) {
        }
        if (first.variable == e.variable && fmu_system.changed(f->system, e.variable->block) != 0) {
            return 0;
        }
    }
    return 1;
}

int fmu_check_parameters(Fmu *f)
{
    const int accepted = check_blocks(f);
    uint32_t at = 0u;
    Entry e;
    if (!accepted) {
        while (next_entry(f, &at, &e)) {
            memcpy((uint8_t *)fmu_system.memory(f->system, e.variable->block) + e.variable->offset, e.old, e.size);
        }
        (void)check_blocks(f);
    }
    f->moment->journal = 0u;
    return accepted;
}

/* Messages that were set, and whose heads the importer leaves to the FMU. */
static void give_heads(Fmu *f)
{
    uint32_t i;
    for (i = 0u; i < f->layout->n_messages; ++i) {
        const FmuMessage *m = &f->layout->messages[i];
        if (f->inputs[i] == FMU_CHANGED) {
            uint8_t *place = (uint8_t *)fmu_system.memory(f->system, m->block) + m->offset;
            Head head = {0, QUALITY_NONE, 0u};
            if (f->moment->phase > FMU_INITIALIZING) { /* until then the instant 0 may run several times */
                memcpy(&head, place, sizeof head);
            }
            head = head_next(head, f->moment->now, QUALITY_GOOD);
            memcpy(place, &head, sizeof head);
        }
    }
}

static void forget_changes(Fmu *f)
{
    uint32_t i;
    for (i = 0u; i < f->layout->n_messages; ++i) {
        f->inputs[i] &= (uint8_t)~FMU_CHANGED;
    }
}

/* ---- initialization */

static double magnitude(double x)
{
    return x < 0.0 ? -x : x;
}

int fmu_begin(Fmu *f, const char *function)
{
    if (!fmu_check_parameters(f)) {
        (void)fmu_refuse(f, FMU_FAILED, function, "a parameter is out of its bounds");
        return 0;
    }
    give_heads(f);
    f->begun = 1;
    if (fmu_system.begin(f->system) != 0) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the instant 0 cannot run");
        return 0;
    }
    return 1;
}

int fmu_compute(Fmu *f, const char *function)
{
    if (f->moment->phase == FMU_INITIALIZING && !f->moment->computed) {
        if (!fmu_begin(f, function)) {
            return 0;
        }
        f->moment->computed = 1u;
    }
    return 1;
}

FmuStatus fmu_enter_initialization(Fmu *f, const char *function, double start, int bounded, double stop)
{
    if (!fmu_may(f, function, FMU_INSTANTIATED)) {
        return FMU_FAILED;
    }
    if (!(magnitude(start) < 1e300) || (bounded && !(stop >= start))) {
        return fmu_refuse(f, FMU_FAILED, function,
                          "the start time must be a number, and the stop time not before it; "
                          "found %g s and %g s",
                          start, stop);
    }
    if (!fmu_check_parameters(f)) {
        return fmu_refuse(f, FMU_FAILED, function, "a parameter is out of its bounds");
    }
    f->moment->time = f->moment->start = start;
    f->moment->bounded = bounded != 0;
    f->moment->stop = stop;
    f->moment->phase = FMU_INITIALIZING;
    return FMU_DONE;
}

FmuStatus fmu_exit_initialization(Fmu *f, const char *function)
{
    if (!fmu_may(f, function, FMU_INITIALIZING) || !fmu_compute(f, function)) {
        return FMU_FAILED;
    }
    forget_changes(f);
    f->moment->phase = f->event_mode ? FMU_EVENTS : FMU_STEPPING;
    return FMU_DONE;
}

/* ---- steps */

static uint32_t ticks(const Fmu *f, uint32_t i)
{
    const uint32_t n = f->layout->n_processes;
    return i < n ? fmu_system.entered(f->system, i) : fmu_system.fired(f->system, i - n);
}

int fmu_ticked(const Fmu *f, uint32_t i)
{
    return ticks(f, i) != f->seen[i];
}

int fmu_any_ticked(const Fmu *f)
{
    uint32_t i;
    for (i = 0u; i < f->layout->n_processes + f->layout->n_events; ++i) {
        if (fmu_ticked(f, i)) {
            return 1;
        }
    }
    return 0;
}

void fmu_forget_ticks(Fmu *f)
{
    uint32_t i;
    for (i = 0u; i < f->layout->n_processes + f->layout->n_events; ++i) {
        f->seen[i] = ticks(f, i);
    }
}

static int64_t nearest(double x)
{
    return (int64_t)(x < 0.0 ? x - 0.5 : x + 0.5);
}

/* [s] How wrong a time of the importer may be: it has few digits if the start is in 1970, and errors grow with the
 * steps that are added up. */
static double error_of(const Fmu *f, double time)
{
    const double start = f->moment->start;
    return 4.0 * DBL_EPSILON * (magnitude(time) + magnitude(start)) + 1e-11 * magnitude(time - start);
}

/* [ns] The end of a step. A step of a whole number of ns is that long, whatever its begin; else its end is the roundest
 * number that the importer can mean. */
static int64_t end_of(const Fmu *f, double time, double step)
{
    const double length = step * 1e9;
    const double end = (time + step - f->moment->start) * 1e9;
    const double error = error_of(f, time + step) * 1e9;
    int64_t unit;
    if (magnitude(length - (double)nearest(length)) < 1e-3) {
        return f->moment->now + nearest(length);
    }
    for (unit = 1000000000000; unit > 1 && error > 0.5; unit /= 10) {
        const int64_t round = (int64_t)((end + error) / (double)unit) * unit;
        if ((double)round >= end - error) {
            return round;
        }
    }
    return nearest(end);
}

/* Whether the importer's step can be run. */
static int step_is_possible(Fmu *f, const char *function, double time, double step)
{
    const FmuMoment *m = f->moment;
    const double now = m->start + tick_seconds(m->now);
    const double slack = 0.1 * step + 1e-9 + error_of(f, time);
    if (!(step > 0.0)) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the step must be > 0 s, found %g s", step);
    } else if (!(magnitude(time - now) <= slack)) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the step must begin where the FMU is, at %.9g s; found %.9g s", now,
                         time);
    } else if (m->bounded && time + step > m->stop + slack) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the step ends at %.9g s, after the stop time %.9g s", time + step,
                         m->stop);
    } else if (!(time + step - m->start < 8e9)) {
        (void)fmu_refuse(f, FMU_FAILED, function, "the FMU runs for at most 8e9 s");
    } else {
        return 1;
    }
    return 0;
}

/* Of the modes that the importer requests anew; a mode that the system refuses, as flight may, is in the log alone. */
static void enter_modes(Fmu *f)
{
    uint32_t i;
    for (i = 0u; i < f->layout->n_processes; ++i) {
        if (f->request[i] != f->entered[i] && f->request[i] != 0) {
            (void)fmu_system.enter(f->system, i, f->request[i] - 1);
        }
        f->entered[i] = f->request[i];
    }
}

FmuStatus fmu_step(Fmu *f, const char *function, double time, double step)
{
    FmuMoment *m;
    int64_t until;
    if (!fmu_may(f, function, FMU_STEPPING) || !step_is_possible(f, function, time, step)) {
        return FMU_FAILED;
    }
    if (!fmu_check_parameters(f)) {
        return fmu_refuse(f, FMU_DISCARDED, function,
                          "a parameter was out of its bounds; all that were set since the "
                          "last step have their old values again");
    }
    m = f->moment;
    fmu_forget_ticks(f);
    enter_modes(f);
    give_heads(f);
    forget_changes(f);
    until = end_of(f, time, step);
    if (until < m->now) {
        until = m->now;
    }
    if (fmu_system.advance(f->system, until, f->early_return, &m->now) != 0) {
        return fmu_refuse(f, FMU_FAILED, function, "the step failed");
    }
    m->time = m->now == until ? time + step : m->start + tick_seconds(m->now);
    return FMU_DONE;
}

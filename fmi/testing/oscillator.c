/* SPDX-License-Identifier: Apache-2.0 */
/* An FMU for tests, of 2.0 and 3.0: an oscillator, x'' = force - omega^2 x, solved in closed form over each step, and
 * outputs that repeat inputs of all types. oscillator.py has its description and makes the .fmu.
 *
 * The variable OSCILLATOR of the environment lets it misbehave: "KIND FUNCTION", as in "segv DoStep", the function
 * without fmi2 or fmi3, and perhaps " TIME" [s], before which it behaves. Kinds are segv, fpe, abort, overflow and
 * smash (of the stack), thread (one of its own crashes), endless, error, fatal, negative and large (as status), nothing
 * (it does nothing: DoStep makes no progress, Instantiate gives no instance), version (a wrong one), nan (as outputs),
 * grow and huge (of states) and end (DoStep ends the simulation); "segv Library" crashes when it is unloaded. */
#define _POSIX_C_SOURCE 200809L
#include "fmi/standard/fmi2.h"
#include "fmi/standard/fmi3.h"

#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct Echo {
    float f32;
    int8_t i8;
    uint8_t u8;
    int16_t i16;
    uint16_t u16;
    int32_t i32;
    uint32_t u32;
    int64_t i64;
    uint64_t u64;
    bool flag;
    char text[64];
    int64_t choice;
    double array[3];
} Echo;

typedef struct Values {
    double t, x, v, force, omega, x0;
    double longest; ///< [s] a step; 0: any
    double every;   ///< [s] between events; 0: none
    int32_t events;
    bool ticks;
    Echo in, out;
    double start;
    int initializes;
} Values;

typedef struct Oscillator {
    Values now;
    bool early; ///< it may return early
    size_t extra;
    void *environment;
    fmi3LogMessageCallback log3;
    fmi2CallbackLogger log2;
} Oscillator;

typedef struct State {
    Values values;
    size_t size; ///< of its bytes
} State;

/* ---- variables */

typedef struct Row {
    uint32_t reference, n;
    char type;  ///< of 3.0: f, d, b, B, h, H, i, I, q, Q; ?: a Boolean; s: a text; e: an enumeration
    char given; ///< 1: it can be set
    size_t offset;
} Row;

#define AT(member) offsetof(Values, member)
#define ECHO(i, name, type, n)                                                                                         \
    {10u + i, n, type, 1, AT(in.name)},                                                                                \
    {                                                                                                                  \
        30u + i, n, type, 0, AT(out.name)                                                                              \
    }
static const Row rows[] = {
    {0u, 1u, 'd', 0, AT(t)},      {1u, 1u, 'd', 0, AT(x)},   {2u, 1u, 'd', 0, AT(v)},       {3u, 1u, 'd', 1, AT(force)},
    {4u, 1u, 'd', 1, AT(omega)},  {5u, 1u, 'd', 1, AT(x0)},  {6u, 1u, 'd', 1, AT(longest)}, {7u, 1u, 'd', 1, AT(every)},
    {8u, 1u, 'i', 0, AT(events)}, ECHO(0u, f32, 'f', 1u),    ECHO(1u, i8, 'b', 1u),         ECHO(2u, u8, 'B', 1u),
    ECHO(3u, i16, 'h', 1u),       ECHO(4u, u16, 'H', 1u),    ECHO(5u, i32, 'i', 1u),        ECHO(6u, u32, 'I', 1u),
    ECHO(7u, i64, 'q', 1u),       ECHO(8u, u64, 'Q', 1u),    ECHO(9u, flag, '?', 1u),       ECHO(10u, text, 's', 1u),
    ECHO(11u, choice, 'e', 1u),   ECHO(12u, array, 'd', 3u),
};
enum { CLOCK = 9 };

static size_t size_of(char type)
{
    static const char types[] = "fdbBhHiIqQ?se";
    static const size_t sizes[] = {4u, 8u, 1u, 1u, 2u, 2u, 4u, 4u, 8u, 8u, sizeof(bool), sizeof((Echo *)0)->text, 8u};
    return sizes[strchr(types, type) - types];
}

/* The place of the element of a reference, in 3.0 the first one of its array; null: there is none that fits. */
static char *place(Oscillator *o, uint32_t reference, const char *types, int set, const Row **found)
{
    for (size_t i = 0u; i < sizeof rows / sizeof *rows; i++) {
        const Row *row = &rows[i];
        if (reference >= row->reference && reference < row->reference + row->n && strchr(types, row->type) != NULL &&
            (row->given || !set)) {
            *found = row;
            return (char *)&o->now + row->offset + (reference - row->reference) * size_of(row->type);
        }
    }
    return NULL;
}

/* ---- faults */

static void say(Oscillator *o, int status, const char *text)
{
    if (o != NULL && o->log3 != NULL) {
        o->log3(o->environment, (fmi3Status)status, "faults", text);
    } else if (o != NULL && o->log2 != NULL) {
        o->log2(o->environment, "oscillator", (fmi2Status)status, "faults", "%s", text);
    }
}

/* Whether it shall misbehave in this way here. */
static int is(const Oscillator *o, const char *kind, const char *function)
{
    const char *text = getenv("OSCILLATOR");
    char wanted[2][40] = {"", ""};
    double from = 0.0;
    if (text == NULL || sscanf(text, "%39s %39s %lf", wanted[0], wanted[1], &from) < 2) {
        return 0;
    }
    return strcmp(wanted[0], kind) == 0 && strcmp(wanted[1], function) == 0 && (o == NULL || o->now.t >= from);
}

static volatile int *volatile nowhere = NULL;
static volatile int on = 1;

static int deep(int n)
{
    volatile char room[1000];
    room[n % 1000] = 1;
    return on ? deep(n + 1) + room[n % 1000] : 0;
}

__attribute__((noinline)) static void smash(void)
{
    char room[8];
    volatile char *volatile at = room;
    for (int i = 0; i < 64; i++) {
        at[i] = 'A';
    }
}

static void *crash(void *unused)
{
    *nowhere = 1;
    return unused;
}

__attribute__((destructor)) static void unload(void)
{
    if (is(NULL, "segv", "Library")) {
        *nowhere = 1;
    }
}

/* The status of a function, if it comes back: 0, or an error. */
static int enter(Oscillator *o, const char *function)
{
    if (is(o, "segv", function)) {
        *nowhere = 1;
    } else if (is(o, "overflow", function)) {
        on = deep(0) != 0;
    } else if (is(o, "smash", function)) {
        smash();
    } else if (is(o, "thread", function)) {
        pthread_t thread;
        pthread_create(&thread, NULL, crash, NULL);
        pthread_join(thread, NULL);
    } else if (is(o, "fpe", function)) {
        raise(SIGFPE);
    } else if (is(o, "abort", function)) {
        abort();
    }
    while (on && is(o, "endless", function)) {
    }
    if (is(o, "negative", function) || is(o, "large", function)) {
        return is(o, "large", function) ? 77 : -1;
    }
    const int status = is(o, "fatal", function) ? fmi3Fatal : (is(o, "error", function) ? fmi3Error : fmi3OK);
    if (status != fmi3OK) {
        say(o, status, "this function fails on purpose");
    }
    return status;
}

/* ---- what it computes */

static void compute_outputs(Oscillator *o)
{
    o->now.out = o->now.in;
    if (is(o, "nan", "DoStep")) {
        o->now.x = o->now.v = NAN;
    }
}

/* x(t + h) for a constant force. */
static void advance(Values *now, double h)
{
    const double rest = now->force / (now->omega * now->omega), c = cos(now->omega * h), s = sin(now->omega * h);
    const double from = now->x - rest;
    now->x = rest + from * c + now->v / now->omega * s;
    now->v = now->v * c - from * now->omega * s;
    now->t += h;
}

/* Until a time, or until where it stops before; an event stops it if `stops`. */
static void run(Oscillator *o, double until, int stops)
{
    Values *now = &o->now;
    const double end = now->longest > 0.0 && until - now->t > now->longest ? now->t + now->longest : until;
    now->ticks = false;
    for (double event; now->every > 0.0 && !(now->ticks && stops); now->ticks = true) {
        event = now->start + now->every * (double)(now->events + 1);
        if (event > end + 1e-12) {
            break;
        }
        advance(now, event - now->t);
        now->events++;
    }
    if (!(now->ticks && stops)) {
        advance(now, end - now->t);
        now->t = end;
    }
    compute_outputs(o);
}

static void begin_anew(Oscillator *o)
{
    const Values start = {.omega = 2.0, .x0 = 1.0, .x = 1.0};
    o->now = start;
}

static Oscillator *make(void)
{
    Oscillator *o = is(NULL, "nothing", "Instantiate") ? NULL : calloc(1u, sizeof *o);
    if (o != NULL) {
        begin_anew(o);
    }
    return o;
}

static void initialize(Oscillator *o)
{
    o->now.x = o->now.x0;
    o->now.v = 0.0;
    compute_outputs(o);
}

/* ---- values and states; all return a status of both versions */

static int get(Oscillator *o, const char *function, uint32_t reference, const char *types, void *to, size_t size)
{
    const Row *row = NULL;
    const char *from = place(o, reference, types, 0, &row);
    if (from == NULL) {
        say(o, fmi3Error, function);
        return fmi3Error;
    }
    if (o->now.initializes) {
        initialize(o);
    }
    memcpy(to, from, size);
    return fmi3OK;
}

static int set(Oscillator *o, const char *function, uint32_t reference, const char *types, const void *from,
               size_t size)
{
    const Row *row = NULL;
    char *to = place(o, reference, types, 1, &row);
    if (to == NULL) {
        say(o, fmi3Error, function);
        return fmi3Error;
    }
    memcpy(to, from, size);
    return fmi3OK;
}

static int save(Oscillator *o, void **state)
{
    State *kept = *state != NULL ? *state : malloc(sizeof *kept);
    o->extra += is(o, "grow", "GetFMUState") ? 1000u : 0u;
    kept->values = o->now;
    kept->size = sizeof kept->values + o->extra;
    *state = kept;
    return fmi3OK;
}

static int serialize(const State *state, void *bytes, size_t size)
{
    if (size < state->size) {
        return fmi3Error;
    }
    memset(bytes, 0, size);
    memcpy(bytes, &state->values, sizeof state->values);
    return fmi3OK;
}

static int deserialize(const void *bytes, size_t size, void **state)
{
    State *made = size >= sizeof made->values ? malloc(sizeof *made) : NULL;
    if (made == NULL) {
        return fmi3Error;
    }
    memcpy(&made->values, bytes, sizeof made->values);
    made->size = size;
    *state = made;
    return fmi3OK;
}

/* ---- 3.0 */

#define ENTER3(o, function)                                                                                            \
    const fmi3Status status = (fmi3Status)enter(o, function);                                                          \
    if (status != fmi3OK) {                                                                                            \
        return status;                                                                                                 \
    }

const char *fmi3GetVersion(void)
{
    return is(NULL, "version", "GetVersion") ? "3.7" : "3.0";
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference intermediate[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)intermediate, (void)n, (void)update;
    (void)enter(NULL, "Instantiate");
    Oscillator *o = make();
    if (o != NULL && strcmp(token, "oscillator") != 0) {
        log(environment, fmi3Error, "faults", "the token is another one");
        free(o);
        return NULL;
    }
    if (o != NULL) {
        o->environment = environment;
        o->log3 = log;
        o->early = early;
    }
    return o;
}

void fmi3FreeInstance(fmi3Instance o)
{
    (void)enter(o, "FreeInstance");
    free(o);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance o, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)on, (void)n, (void)categories;
    return (fmi3Status)enter(o, "SetDebugLogging");
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean limited, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean ends, fmi3Float64 stop)
{
    Oscillator *o = instance;
    (void)limited, (void)tolerance, (void)ends, (void)stop;
    ENTER3(o, "EnterInitializationMode")
    o->now.t = o->now.start = start;
    o->now.initializes = 1;
    return fmi3OK;
}

static int leave_initialization(Oscillator *o)
{
    const int status = enter(o, "ExitInitializationMode");
    initialize(o);
    o->now.initializes = 0;
    return status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance o)
{
    return (fmi3Status)leave_initialization(o);
}

static int reset(Oscillator *o)
{
    const int status = enter(o, "Reset");
    begin_anew(o);
    return status;
}

fmi3Status fmi3Reset(fmi3Instance o)
{
    return (fmi3Status)reset(o);
}

#define PLAIN3(function)                                                                                               \
    fmi3Status fmi3##function(fmi3Instance o)                                                                          \
    {                                                                                                                  \
        return (fmi3Status)enter(o, #function);                                                                        \
    }
PLAIN3(EnterEventMode)
PLAIN3(EnterStepMode)
PLAIN3(Terminate)
PLAIN3(EnterConfigurationMode)
PLAIN3(ExitConfigurationMode)
PLAIN3(EvaluateDiscreteStates)

#define ACCESS3(T, types)                                                                                              \
    fmi3Status fmi3Get##T(fmi3Instance o, const fmi3ValueReference references[], size_t n, fmi3##T values[],           \
                          size_t n_values)                                                                             \
    {                                                                                                                  \
        ENTER3(o, "Get" #T)                                                                                            \
        const size_t each = n > 0u ? n_values / n : 0u;                                                                \
        int bad = 0;                                                                                                   \
        for (size_t i = 0u; i < n && !bad; i++) {                                                                      \
            bad = get(o, "Get" #T, references[i], types, &values[i * each], each * sizeof values[0]);                  \
        }                                                                                                              \
        return (fmi3Status)bad;                                                                                        \
    }                                                                                                                  \
    fmi3Status fmi3Set##T(fmi3Instance o, const fmi3ValueReference references[], size_t n, const fmi3##T values[],     \
                          size_t n_values)                                                                             \
    {                                                                                                                  \
        ENTER3(o, "Set" #T)                                                                                            \
        const size_t each = n > 0u ? n_values / n : 0u;                                                                \
        int bad = 0;                                                                                                   \
        for (size_t i = 0u; i < n && !bad; i++) {                                                                      \
            bad = set(o, "Set" #T, references[i], types, &values[i * each], each * sizeof values[0]);                  \
        }                                                                                                              \
        return (fmi3Status)bad;                                                                                        \
    }
ACCESS3(Float32, "f")
ACCESS3(Float64, "d")
ACCESS3(Int8, "b")
ACCESS3(UInt8, "B")
ACCESS3(Int16, "h")
ACCESS3(UInt16, "H")
ACCESS3(Int32, "i")
ACCESS3(UInt32, "I")
ACCESS3(Int64, "qe")
ACCESS3(UInt64, "Q")
ACCESS3(Boolean, "?")

static int get_text(Oscillator *o, uint32_t reference, const char **value)
{
    const Row *row = NULL;
    if (o->now.initializes) {
        initialize(o);
    }
    *value = place(o, reference, "s", 0, &row);
    return *value != NULL ? fmi3OK : fmi3Error;
}

static int set_text(Oscillator *o, uint32_t reference, const char *value)
{
    char text[sizeof o->now.in.text] = "";
    strncpy(text, value, sizeof text - 1u);
    return set(o, "SetString", reference, "s", text, sizeof text);
}

fmi3Status fmi3GetString(fmi3Instance o, const fmi3ValueReference references[], size_t n, fmi3String values[],
                         size_t n_values)
{
    ENTER3(o, "GetString")
    return n == 1u && n_values == 1u ? (fmi3Status)get_text(o, references[0], &values[0]) : fmi3Error;
}

fmi3Status fmi3SetString(fmi3Instance o, const fmi3ValueReference references[], size_t n, const fmi3String values[],
                         size_t n_values)
{
    ENTER3(o, "SetString")
    return n == 1u && n_values == 1u ? (fmi3Status)set_text(o, references[0], values[0]) : fmi3Error;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Clock values[])
{
    Oscillator *o = instance;
    ENTER3(o, "GetClock")
    for (size_t i = 0u; i < n; i++) {
        values[i] = o->now.ticks && references[i] == (uint32_t)CLOCK;
    }
    o->now.ticks = false;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance o, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *timed, fmi3Float64 *next)
{
    *again = is(o, "nothing", "UpdateDiscreteStates");
    *end = is(o, "end", "UpdateDiscreteStates");
    *nominals = *states = *timed = false;
    *next = 0.0;
    return (fmi3Status)enter(o, "UpdateDiscreteStates");
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean ahead, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached)
{
    Oscillator *o = instance;
    (void)ahead;
    ENTER3(o, "DoStep")
    if (!is(o, "nothing", "DoStep")) {
        run(o, t + h, o->early);
    }
    *reached = o->now.t;
    *event = o->now.ticks;
    *end = is(o, "end", "DoStep");
    *early = o->early && o->now.t < t + h;
    return o->now.t < t + h && !*early ? fmi3Discard : fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance o, fmi3FMUState *state)
{
    ENTER3(o, "GetFMUState")
    return (fmi3Status)save(o, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance o, fmi3FMUState state)
{
    ENTER3(o, "SetFMUState")
    ((Oscillator *)o)->now = ((const State *)state)->values;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance o, fmi3FMUState *state)
{
    ENTER3(o, "FreeFMUState")
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance o, fmi3FMUState state, size_t *size)
{
    ENTER3(o, "SerializedFMUStateSize")
    *size = is(o, "huge", "SerializedFMUStateSize") ? (size_t)1 << 60 : ((const State *)state)->size;
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance o, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    ENTER3(o, "SerializeFMUState")
    return (fmi3Status)serialize(state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance o, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    ENTER3(o, "DeserializeFMUState")
    return (fmi3Status)deserialize(bytes, size, state);
}

/* ---- 2.0 */

#define ENTER2(o, function)                                                                                            \
    const fmi2Status status = (fmi2Status)enter(o, function);                                                          \
    if (status != fmi2OK) {                                                                                            \
        return status;                                                                                                 \
    }

const char *fmi2GetVersion(void)
{
    return is(NULL, "version", "GetVersion") ? "2.7" : "2.0";
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    (void)enter(NULL, "Instantiate");
    Oscillator *o = type == fmi2CoSimulation && strcmp(guid, "oscillator") == 0 ? make() : NULL;
    if (o != NULL) {
        o->environment = callbacks->componentEnvironment;
        o->log2 = callbacks->logger;
    }
    return o;
}

void fmi2FreeInstance(fmi2Component o)
{
    fmi3FreeInstance(o);
}

fmi2Status fmi2SetDebugLogging(fmi2Component o, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    return (fmi2Status)fmi3SetDebugLogging(o, on != fmi2False, n, categories);
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean limited, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop)
{
    Oscillator *o = instance;
    (void)limited, (void)tolerance, (void)ends, (void)stop;
    ENTER2(o, "SetupExperiment")
    o->now.t = o->now.start = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance)
{
    Oscillator *o = instance;
    ENTER2(o, "EnterInitializationMode")
    o->now.initializes = 1;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component o)
{
    return (fmi2Status)leave_initialization(o);
}

fmi2Status fmi2Terminate(fmi2Component o)
{
    return (fmi2Status)enter(o, "Terminate");
}

fmi2Status fmi2Reset(fmi2Component o)
{
    return (fmi2Status)reset(o);
}

/* Enumerations have 64 bits here, and 32 in 2.0. */
static int is_enumeration(Oscillator *o, uint32_t reference)
{
    const Row *row = NULL;
    return place(o, reference, "e", 0, &row) != NULL;
}

static int get_integer(Oscillator *o, uint32_t reference, int *value)
{
    int64_t wide = 0;
    if (!is_enumeration(o, reference)) {
        return get(o, "GetInteger", reference, "i", value, sizeof *value);
    }
    const int status = get(o, "GetInteger", reference, "e", &wide, sizeof wide);
    *value = (int)wide;
    return status;
}

static int set_integer(Oscillator *o, uint32_t reference, const int *value)
{
    const int64_t wide = *value;
    return is_enumeration(o, reference) ? set(o, "SetInteger", reference, "e", &wide, sizeof wide)
                                        : set(o, "SetInteger", reference, "i", value, sizeof *value);
}

static int get_real(Oscillator *o, uint32_t reference, double *value)
{
    return get(o, "GetReal", reference, "d", value, sizeof *value);
}

static int set_real(Oscillator *o, uint32_t reference, const double *value)
{
    return set(o, "SetReal", reference, "d", value, sizeof *value);
}

static int get_boolean(Oscillator *o, uint32_t reference, int *value)
{
    bool flag = false;
    const int status = get(o, "GetBoolean", reference, "?", &flag, sizeof flag);
    *value = flag;
    return status;
}

static int set_boolean(Oscillator *o, uint32_t reference, const int *value)
{
    const bool flag = *value != 0;
    return set(o, "SetBoolean", reference, "?", &flag, sizeof flag);
}

static int set_string(Oscillator *o, uint32_t reference, const fmi2String *value)
{
    return set_text(o, reference, *value);
}

#define ACCESS2(T, read, write)                                                                                        \
    fmi2Status fmi2Get##T(fmi2Component o, const fmi2ValueReference references[], size_t n, fmi2##T values[])          \
    {                                                                                                                  \
        int bad = enter(o, "Get" #T);                                                                                  \
        for (size_t i = 0u; i < n && !bad; i++) {                                                                      \
            bad = read(o, references[i], &values[i]);                                                                  \
        }                                                                                                              \
        return (fmi2Status)bad;                                                                                        \
    }                                                                                                                  \
    fmi2Status fmi2Set##T(fmi2Component o, const fmi2ValueReference references[], size_t n, const fmi2##T values[])    \
    {                                                                                                                  \
        int bad = enter(o, "Set" #T);                                                                                  \
        for (size_t i = 0u; i < n && !bad; i++) {                                                                      \
            bad = write(o, references[i], &values[i]);                                                                 \
        }                                                                                                              \
        return (fmi2Status)bad;                                                                                        \
    }
ACCESS2(Real, get_real, set_real)
ACCESS2(Integer, get_integer, set_integer)
ACCESS2(Boolean, get_boolean, set_boolean)
ACCESS2(String, get_text, set_string)

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real t, fmi2Real h, fmi2Boolean ahead)
{
    Oscillator *o = instance;
    (void)ahead;
    ENTER2(o, "DoStep")
    if (!is(o, "nothing", "DoStep")) {
        run(o, t + h, 0);
    }
    return o->now.t < t + h || is(o, "end", "DoStep") ? fmi2Discard : fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component o, const fmi2StatusKind kind, fmi2Real *value)
{
    ENTER2(o, "GetRealStatus")
    *value = ((const Oscillator *)o)->now.t;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component o, const fmi2StatusKind kind, fmi2Boolean *value)
{
    ENTER2(o, "GetBooleanStatus")
    *value = is(o, "end", "DoStep");
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetFMUstate(fmi2Component o, fmi2FMUstate *state)
{
    return (fmi2Status)fmi3GetFMUState(o, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component o, fmi2FMUstate state)
{
    return (fmi2Status)fmi3SetFMUState(o, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component o, fmi2FMUstate *state)
{
    return (fmi2Status)fmi3FreeFMUState(o, state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component o, fmi2FMUstate state, size_t *size)
{
    return (fmi2Status)fmi3SerializedFMUStateSize(o, state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component o, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return (fmi2Status)fmi3SerializeFMUState(o, state, (fmi3Byte *)bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component o, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return (fmi2Status)fmi3DeserializeFMUState(o, (const fmi3Byte *)bytes, size, state);
}

/* ---- what is not offered, of both: no test calls it with arguments that count */

#define REFUSED(name)                                                                                                  \
    int name(void);                                                                                                    \
    int name(void)                                                                                                     \
    {                                                                                                                  \
        return fmi3Error;                                                                                              \
    }
REFUSED(fmi3GetBinary)
REFUSED(fmi3SetBinary)
REFUSED(fmi3SetClock)
REFUSED(fmi3GetNumberOfVariableDependencies)
REFUSED(fmi3GetVariableDependencies)
REFUSED(fmi3GetDirectionalDerivative)
REFUSED(fmi3GetAdjointDerivative)
REFUSED(fmi3GetOutputDerivatives)
REFUSED(fmi3GetIntervalDecimal)
REFUSED(fmi3GetIntervalFraction)
REFUSED(fmi3GetShiftDecimal)
REFUSED(fmi3GetShiftFraction)
REFUSED(fmi3SetIntervalDecimal)
REFUSED(fmi3SetIntervalFraction)
REFUSED(fmi3SetShiftDecimal)
REFUSED(fmi3SetShiftFraction)
REFUSED(fmi2GetDirectionalDerivative)
REFUSED(fmi2SetRealInputDerivatives)
REFUSED(fmi2GetRealOutputDerivatives)
REFUSED(fmi2CancelStep)
REFUSED(fmi2GetStatus)
REFUSED(fmi2GetIntegerStatus)
REFUSED(fmi2GetStringStatus)

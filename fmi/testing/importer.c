/* SPDX-License-Identifier: Apache-2.0 */
#define _POSIX_C_SOURCE 200809L /* of dlopen */
#include "fmi/testing/importer.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

enum { MANY = 4096 }; /* elements of a variable */

static int failed(const ImporterFmu *fmu, const char *function, const char *what)
{
    fprintf(stderr, "%s: %s: %s\n", fmu->name, function, what);
    return -1;
}

static int checked(const ImporterFmu *fmu, const char *function, int status)
{
    static const char *const names[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};
    return status <= 1 ? 0 : failed(fmu, function, status < 6 ? names[status] : "no status of the standard");
}

#define CALL2(fmu, function, ...) checked(fmu, "fmi2" #function, (int)(fmu)->two.function(__VA_ARGS__))
#define CALL3(fmu, function, ...) checked(fmu, "fmi3" #function, (int)(fmu)->three.function(__VA_ARGS__))

static void print3(fmi3InstanceEnvironment fmu, fmi3Status status, fmi3String category, fmi3String message)
{
    fprintf(stderr, "%s: log, status %d, %s: %s\n", ((const ImporterFmu *)fmu)->name, (int)status, category, message);
}

static void print2(fmi2ComponentEnvironment fmu, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    va_list arguments;
    (void)instance;
    fprintf(stderr, "%s: log, status %d, %s: ", ((const ImporterFmu *)fmu)->name, (int)status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

/* ---- instances */

static int resolve(ImporterFmu *fmu, const char *name, void *function, size_t size)
{
    void *symbol = dlsym(fmu->handle, name);
    memcpy(function, &symbol, size); /* ISO C has no conversion of an object's pointer to that of a function */
    return symbol != NULL ? 0 : failed(fmu, name, "is missing");
}

#define RESOLVE2(f) bad = bad || resolve(fmu, "fmi2" #f, &fmu->two.f, sizeof fmu->two.f);
#define RESOLVE3(f) bad = bad || resolve(fmu, "fmi3" #f, &fmu->three.f, sizeof fmu->three.f);

int importer_open(ImporterFmu *fmu)
{
    int bad = 0;
    fmu->handle = dlopen(fmu->library, RTLD_NOW | RTLD_LOCAL);
    if (fmu->handle == NULL) {
        return failed(fmu, "dlopen", dlerror());
    }
    if (fmu->version == 2) {
        FMI2_CO_SIMULATION(RESOLVE2)
        if (bad || strcmp(fmu->two.GetVersion(), "2.0") != 0 ||
            strcmp(fmu->two.GetTypesPlatform(), fmi2TypesPlatform) != 0) {
            return failed(fmu, "fmi2GetVersion", "is not 2.0");
        }
        const fmi2CallbackFunctions callbacks = {print2, calloc, free, NULL, fmu};
        char place[1024];
        snprintf(place, sizeof place, "file://%s", fmu->resources);
        fmu->callbacks = callbacks;
        fmu->instance =
            fmu->two.Instantiate(fmu->name, fmi2CoSimulation, fmu->token, place, &fmu->callbacks, fmi2False, fmi2False);
    } else {
        FMI3_CO_SIMULATION(RESOLVE3)
        if (bad || strcmp(fmu->three.GetVersion(), "3.0") != 0) {
            return failed(fmu, "fmi3GetVersion", "is not 3.0");
        }
        fmu->instance =
            fmu->three.InstantiateCoSimulation(fmu->name, fmu->token, fmu->resources, false, false, fmu->events != 0,
                                               fmu->events != 0, NULL, 0u, fmu, print3, NULL);
    }
    return fmu->instance != NULL ? 0 : failed(fmu, "instantiate", "it gives no instance");
}

void importer_close(ImporterFmu *fmu)
{
    if (fmu->instance != NULL && fmu->version == 2) {
        fmu->two.FreeInstance(fmu->instance);
    } else if (fmu->instance != NULL) {
        fmu->three.FreeInstance(fmu->instance);
    }
    if (fmu->handle != NULL) {
        dlclose(fmu->handle);
    }
    fmu->instance = fmu->handle = NULL;
}

int importer_begin(ImporterFmu *fmu, double start)
{
    fmu->t = start;
    if (fmu->version == 3) {
        return CALL3(fmu, EnterInitializationMode, fmu->instance, false, 0.0, start, false, 0.0);
    }
    return CALL2(fmu, SetupExperiment, fmu->instance, fmi2False, 0.0, start, fmi2False, 0.0) ||
                   CALL2(fmu, EnterInitializationMode, fmu->instance)
               ? -1
               : 0;
}

/* Event mode, until nothing changes any more. */
static int handle_events(ImporterFmu *fmu)
{
    fmi3Boolean again = true, end = false, nominals, states, timed;
    fmi3Float64 next;
    fmu->handled++;
    if (fmu->at_event != NULL) {
        fmu->at_event(fmu->user, fmu);
    }
    while (again && !end) {
        if (CALL3(fmu, UpdateDiscreteStates, fmu->instance, &again, &end, &nominals, &states, &timed, &next)) {
            return -1;
        }
    }
    fmu->terminated = fmu->terminated || end;
    return CALL3(fmu, EnterStepMode, fmu->instance);
}

int importer_begun(ImporterFmu *fmu)
{
    if (fmu->version == 2) {
        return CALL2(fmu, ExitInitializationMode, fmu->instance);
    }
    return CALL3(fmu, ExitInitializationMode, fmu->instance) || (fmu->events && handle_events(fmu)) ? -1 : 0;
}

static int step2(ImporterFmu *fmu, double until)
{
    const fmi2Status status = fmu->two.DoStep(fmu->instance, fmu->t, until - fmu->t, fmi2False);
    fmi2Real reached = until;
    fmi2Boolean end = fmi2False;
    if (status == fmi2Discard) {
        fmu->discarded++;
        if (CALL2(fmu, GetRealStatus, fmu->instance, fmi2LastSuccessfulTime, &reached) ||
            CALL2(fmu, GetBooleanStatus, fmu->instance, fmi2Terminated, &end)) {
            return -1;
        }
        fmu->terminated = end != fmi2False;
        if (!(reached > fmu->t) && !end) {
            return failed(fmu, "fmi2DoStep", "it makes no progress");
        }
        fmu->t = reached;
        return 0;
    }
    fmu->t = reached;
    return checked(fmu, "fmi2DoStep", (int)status);
}

static int step3(ImporterFmu *fmu, double until)
{
    fmi3Boolean event = false, end = false, early = false;
    fmi3Float64 reached = fmu->t;
    const fmi3Status status =
        fmu->three.DoStep(fmu->instance, fmu->t, until - fmu->t, false, &event, &end, &early, &reached);
    if (status == fmi3Discard || early) {
        fmu->discarded += status == fmi3Discard;
        fmu->early += early;
        if (!(reached > fmu->t) && !end) {
            return failed(fmu, "fmi3DoStep", "it makes no progress");
        }
    } else if (checked(fmu, "fmi3DoStep", (int)status)) {
        return -1;
    } else {
        reached = until;
    }
    fmu->t = reached;
    fmu->terminated = end;
    if (event && fmu->events) {
        return CALL3(fmu, EnterEventMode, fmu->instance) || handle_events(fmu) ? -1 : 0;
    }
    return 0;
}

int importer_step(ImporterFmu *fmu, double until)
{
    while (fmu->t < until && !fmu->terminated) {
        if (fmu->version == 2 ? step2(fmu, until) : step3(fmu, until)) {
            return -1;
        }
    }
    return 0;
}

int importer_reset(ImporterFmu *fmu)
{
    fmu->terminated = 0;
    return fmu->version == 2 ? CALL2(fmu, Reset, fmu->instance) : CALL3(fmu, Reset, fmu->instance);
}

int importer_end(ImporterFmu *fmu)
{
    return fmu->version == 2 ? CALL2(fmu, Terminate, fmu->instance) : CALL3(fmu, Terminate, fmu->instance);
}

/* ---- values */

#define NUMBERS3(X)                                                                                                    \
    X(F64, Float64)                                                                                                    \
    X(F32, Float32)                                                                                                    \
    X(I8, Int8) X(U8, UInt8) X(I16, Int16) X(U16, UInt16) X(I32, Int32) X(U32, UInt32) X(I64, Int64) X(U64, UInt64)

static int get3(ImporterFmu *fmu, ImporterVariable v, void *values)
{
    fmi3Int64 numbers[MANY];
    fmi3String text = "";
    int result;
    switch (v.type) {
#define GET(ours, theirs)                                                                                              \
    case FLEDGE_##ours: return CALL3(fmu, Get##theirs, fmu->instance, &v.reference, 1u, values, v.n);
        NUMBERS3(GET)
#undef GET
    case FLEDGE_ENUM:
        result = CALL3(fmu, GetInt64, fmu->instance, &v.reference, 1u, numbers, v.n);
        for (uint32_t i = 0u; i < v.n; i++) {
            ((int32_t *)values)[i] = (int32_t)numbers[i];
        }
        return result;
    case FLEDGE_CHAR:
        result = CALL3(fmu, GetString, fmu->instance, &v.reference, 1u, &text, 1u);
        strncpy(values, text, v.n);
        return result;
    case FLEDGE_STRUCT: break;
    }
    return failed(fmu, "get", "a struct is no variable");
}

static int set3(ImporterFmu *fmu, ImporterVariable v, const void *values)
{
    fmi3Int64 numbers[MANY];
    const fmi3String text = values;
    switch (v.type) {
#define SET(ours, theirs)                                                                                              \
    case FLEDGE_##ours: return CALL3(fmu, Set##theirs, fmu->instance, &v.reference, 1u, values, v.n);
        NUMBERS3(SET)
#undef SET
    case FLEDGE_ENUM:
        for (uint32_t i = 0u; i < v.n; i++) {
            numbers[i] = ((const int32_t *)values)[i];
        }
        return CALL3(fmu, SetInt64, fmu->instance, &v.reference, 1u, numbers, v.n);
    case FLEDGE_CHAR: return CALL3(fmu, SetString, fmu->instance, &v.reference, 1u, &text, 1u);
    case FLEDGE_STRUCT: break;
    }
    return failed(fmu, "set", "a struct is no variable");
}

/* Whether 2.0 has the elements as Integer; else as Real. */
static int is_integer(FledgeType type)
{
    return type == FLEDGE_ENUM || (type >= FLEDGE_I8 && type <= FLEDGE_I32);
}

static void list_references(ImporterVariable v, fmi2ValueReference *references)
{
    for (uint32_t i = 0u; i < v.n; i++) {
        references[i] = v.reference + i;
    }
}

static int get2(ImporterFmu *fmu, ImporterVariable v, void *values)
{
    fmi2ValueReference references[MANY];
    fmi2Real reals[MANY];
    fmi2Integer integers[MANY];
    fmi2String text = "";
    int result;
    if (v.type == FLEDGE_CHAR) {
        result = CALL2(fmu, GetString, fmu->instance, &v.reference, 1u, &text);
        strncpy(values, text, v.n);
        return result;
    }
    list_references(v, references);
    result = is_integer(v.type) ? CALL2(fmu, GetInteger, fmu->instance, references, v.n, integers)
                                : CALL2(fmu, GetReal, fmu->instance, references, v.n, reals);
    for (uint32_t i = 0u; i < v.n && result == 0; i++) {
        element_write(v.type, (char *)values + i * element_size(v.type),
                      is_integer(v.type) ? (double)integers[i] : reals[i]);
    }
    return result;
}

static int set2(ImporterFmu *fmu, ImporterVariable v, const void *values)
{
    fmi2ValueReference references[MANY];
    fmi2Real reals[MANY];
    fmi2Integer integers[MANY];
    const fmi2String text = values;
    if (v.type == FLEDGE_CHAR) {
        return CALL2(fmu, SetString, fmu->instance, &v.reference, 1u, &text);
    }
    list_references(v, references);
    for (uint32_t i = 0u; i < v.n; i++) {
        reals[i] = element_read(v.type, (const char *)values + i * element_size(v.type));
        integers[i] = is_integer(v.type) ? (fmi2Integer)reals[i] : 0;
    }
    return is_integer(v.type) ? CALL2(fmu, SetInteger, fmu->instance, references, v.n, integers)
                              : CALL2(fmu, SetReal, fmu->instance, references, v.n, reals);
}

int importer_get(ImporterFmu *fmu, ImporterVariable v, void *values)
{
    memset(values, 0, importer_bytes(v));
    return v.n > MANY ? failed(fmu, "get", "too many elements")
                      : (fmu->version == 2 ? get2(fmu, v, values) : get3(fmu, v, values));
}

int importer_set(ImporterFmu *fmu, ImporterVariable v, const void *values)
{
    return v.n > MANY ? failed(fmu, "set", "too many elements")
                      : (fmu->version == 2 ? set2(fmu, v, values) : set3(fmu, v, values));
}

int importer_ticked(ImporterFmu *fmu, uint32_t clock)
{
    fmi3Clock active = false;
    return CALL3(fmu, GetClock, fmu->instance, &clock, 1u, &active) ? -1 : active;
}

/* ---- states */

int importer_save(ImporterFmu *fmu, ImporterState *state)
{
    state->held = NULL; /* a new one */
    state->t = fmu->t;
    if (fmu->version == 2 ? CALL2(fmu, GetFMUstate, fmu->instance, &state->held) ||
                                CALL2(fmu, SerializedFMUstateSize, fmu->instance, state->held, &state->size)
                          : CALL3(fmu, GetFMUState, fmu->instance, &state->held) ||
                                CALL3(fmu, SerializedFMUStateSize, fmu->instance, state->held, &state->size)) {
        return -1;
    }
    state->bytes = malloc(state->size);
    return fmu->version == 2
               ? CALL2(fmu, SerializeFMUstate, fmu->instance, state->held, (fmi2Byte *)state->bytes, state->size)
               : CALL3(fmu, SerializeFMUState, fmu->instance, state->held, state->bytes, state->size);
}

int importer_restore(ImporterFmu *fmu, const ImporterState *state, int serialised)
{
    ImporterState from = *state;
    int bad = 0;
    if (serialised) {
        from.held = NULL;
        from.bytes = NULL;
        bad = fmu->version == 2 ? CALL2(fmu, DeSerializeFMUstate, fmu->instance, (const fmi2Byte *)state->bytes,
                                        state->size, &from.held)
                                : CALL3(fmu, DeserializeFMUState, fmu->instance, state->bytes, state->size, &from.held);
    }
    fmu->t = state->t;
    fmu->terminated = 0;
    bad = bad || (fmu->version == 2 ? CALL2(fmu, SetFMUstate, fmu->instance, from.held)
                                    : CALL3(fmu, SetFMUState, fmu->instance, from.held));
    return serialised && !bad ? importer_forget(fmu, &from) : (bad ? -1 : 0);
}

int importer_forget(ImporterFmu *fmu, ImporterState *state)
{
    free(state->bytes);
    state->bytes = NULL;
    return fmu->version == 2 ? CALL2(fmu, FreeFMUstate, fmu->instance, &state->held)
                             : CALL3(fmu, FreeFMUState, fmu->instance, &state->held);
}

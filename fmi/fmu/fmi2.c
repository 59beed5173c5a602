/* SPDX-License-Identifier: Apache-2.0 */
/* The functions of FMI 2.0. Those of model exchange, and those of co-simulation that the model description does not
 * offer, exist and refuse. */
#include "fmi/standard/fmi2.h"

#include "fmi/fmu/fmu.h"

#include <stdlib.h>
#include <string.h>

#define DECLARED(name) FMU_EXPORT fmi2##name##TYPE fmi2##name;
FMI2_CO_SIMULATION(DECLARED)
FMI2_OTHER(DECLARED)
#undef DECLARED
FMU_ALIKE(fmi2, fmi2Component, FMUstate, DeSerialize)

/* The logger takes a format: the text has no arguments, and its percent signs are doubled. */
static void deliver(const Fmu *f, FmuStatus status, const char *category, const char *text)
{
    ((fmi2CallbackLogger)f->logger)(f->environment, f->host.instance, (fmi2Status)status, category, text);
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

static int digit(char c)
{
    const char *const digits = "0123456789abcdef0123456789ABCDEF";
    const char *p = c != '\0' ? strchr(digits, c) : NULL;
    return p == NULL ? -1 : (int)((p - digits) % 16);
}

/* The path of a URI "file:///path" or "file:/path", or of a plain path, in memory of its own. */
static char *path_of(const char *uri)
{
    const size_t n = strlen(uri);
    char *path = malloc(n + 1u);
    char *p = path;
    if (path == NULL) {
        return NULL;
    }
    if (strncmp(uri, "file:", 5u) != 0) {
        return memcpy(path, uri, n + 1u);
    }
    uri += 5;
    if (strncmp(uri, "//", 2u) == 0) { /* the name of the machine, mostly none, ends at a slash */
        uri += 2 + strcspn(uri + 2, "/");
    }
    while (*uri != '\0') {
        const int high = uri[0] == '%' ? digit(uri[1]) : -1;
        const int low = high >= 0 ? digit(uri[2]) : -1;
        *p++ = low >= 0 ? (char)(16 * high + low) : *uri;
        uri += low >= 0 ? 3 : 1;
    }
    *p = '\0';
#ifdef _WIN32 /* "/C:/path" */
    if (path[0] == '/' && path[1] != '\0' && path[2] == ':') {
        memmove(path, path + 1, strlen(path));
    }
#endif
    return path;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    FmuSetup setup = {2, name, guid, NULL, loggingOn, 0, 0, deliver, NULL, NULL};
    char *path = path_of(resources != NULL ? resources : "");
    Fmu *f;
    (void)visible;
    if (functions != NULL) {
        setup.logger = (void (*)(void))functions->logger;
        setup.environment = functions->componentEnvironment;
    }
    if (type != fmi2CoSimulation) {
        if (functions != NULL && functions->logger != NULL) {
            functions->logger(functions->componentEnvironment, name, fmi2Error, "errors",
                              "fmi2Instantiate: this FMU is for co-simulation alone");
        }
        free(path);
        return NULL;
    }
    setup.resources = path;
    f = fmu_new(&setup);
    free(path);
    return f;
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    Fmu *f = instance;
    (void)toleranceDefined;
    (void)tolerance;
    if (!fmu_may(f, "fmi2SetupExperiment", FMU_INSTANTIATED)) {
        return fmi2Error;
    }
    f->moment->start = startTime;
    f->moment->bounded = stopTimeDefined != 0;
    f->moment->stop = stopTime;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance)
{
    Fmu *f = instance;
    return f == NULL ? fmi2Error
                     : (fmi2Status)fmu_enter_initialization(f, "fmi2EnterInitializationMode", f->moment->start,
                                                            (int)f->moment->bounded, f->moment->stop);
}

fmi2Status fmi2Terminate(fmi2Component instance)
{
    Fmu *f = instance;
    if (!fmu_may(f, "fmi2Terminate", FMU_STEPPING)) {
        return fmi2Error;
    }
    f->moment->phase = FMU_TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real currentPoint, fmi2Real stepSize, fmi2Boolean noSetStatePrior)
{
    (void)noSetStatePrior;
    return (fmi2Status)fmu_step(instance, "fmi2DoStep", currentPoint, stepSize);
}

/* ---- what a step has reached, after fmi2Discard: nothing */

static fmi2Status no_status(Fmu *f, const char *function)
{
    return fmu_may(f, function, FMU_STEPPING | FMU_TERMINATED)
               ? (fmi2Status)fmu_refuse(f, FMU_DISCARDED, function, "the FMU has no such status")
               : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value)
{
    const Fmu *f = instance;
    if (kind == fmi2LastSuccessfulTime && f != NULL && (f->moment->phase & (FMU_STEPPING | FMU_TERMINATED)) != 0u) {
        *value = f->moment->time;
        return fmi2OK;
    }
    return no_status(instance, "fmi2GetRealStatus");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value)
{
    const Fmu *f = instance;
    if (kind == fmi2Terminated && f != NULL && (f->moment->phase & (FMU_STEPPING | FMU_TERMINATED)) != 0u) {
        *value = fmi2False;
        return fmi2OK;
    }
    return no_status(instance, "fmi2GetBooleanStatus");
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind;
    (void)value;
    return no_status(instance, "fmi2GetStatus");
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind;
    (void)value;
    return no_status(instance, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind;
    (void)value;
    return no_status(instance, "fmi2GetStringStatus");
}

/* ---- variables. A Real has every integer that an Integer cannot have, exactly below 2^53; Booleans exist in no
 * struct. */

#define BIT(type) (1u << FLEDGE_##type)
#define ACCESS(name, kind, types)                                                                                      \
    fmi2Status fmi2Get##name(fmi2Component instance, const fmi2ValueReference references[], size_t n,                  \
                             fmi2##name values[])                                                                      \
    {                                                                                                                  \
        const FmuCall call = {"fmi2Get" #name, FLEDGE_##kind, types, references, n, n};                                \
        return (fmi2Status)fmu_get(instance, &call, values);                                                           \
    }                                                                                                                  \
    fmi2Status fmi2Set##name(fmi2Component instance, const fmi2ValueReference references[], size_t n,                  \
                             const fmi2##name values[])                                                                \
    {                                                                                                                  \
        const FmuCall call = {"fmi2Set" #name, FLEDGE_##kind, types, references, n, n};                                \
        return (fmi2Status)fmu_set(instance, &call, values);                                                           \
    }
ACCESS(Real, F64, BIT(F64) | BIT(F32) | BIT(U32) | BIT(I64) | BIT(U64))
ACCESS(Integer, I32, BIT(I8) | BIT(U8) | BIT(I16) | BIT(U16) | BIT(I32) | BIT(ENUM))
ACCESS(Boolean, I32, 0u)
ACCESS(String, CHAR, BIT(CHAR))

/* ---- what is not offered */

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define REFUSED(name, ...)                                                                                             \
    fmi2Status fmi2##name(__VA_ARGS__)                                                                                 \
    {                                                                                                                  \
        return (fmi2Status)fmu_refuse(instance, FMU_FAILED, "fmi2" #name, "this FMU does not offer it");               \
    }
#define INSTANCE fmi2Component instance
#define REFERENCES INSTANCE, const fmi2ValueReference references[], size_t n

REFUSED(SetRealInputDerivatives, REFERENCES, const fmi2Integer orders[], const fmi2Real values[])
REFUSED(GetRealOutputDerivatives, REFERENCES, const fmi2Integer orders[], fmi2Real values[])
REFUSED(GetDirectionalDerivative, INSTANCE, const fmi2ValueReference unknowns[], size_t nUnknowns,
        const fmi2ValueReference knowns[], size_t nKnowns, const fmi2Real seed[], fmi2Real sensitivity[])
REFUSED(CancelStep, INSTANCE)

REFUSED(EnterEventMode, INSTANCE)
REFUSED(NewDiscreteStates, INSTANCE, fmi2EventInfo *info)
REFUSED(EnterContinuousTimeMode, INSTANCE)
REFUSED(CompletedIntegratorStep, INSTANCE, fmi2Boolean noSetStatePrior, fmi2Boolean *enterEventMode,
        fmi2Boolean *terminate)
REFUSED(SetTime, INSTANCE, fmi2Real time)
REFUSED(SetContinuousStates, INSTANCE, const fmi2Real states[], size_t n)
REFUSED(GetContinuousStates, INSTANCE, fmi2Real states[], size_t n)
REFUSED(GetDerivatives, INSTANCE, fmi2Real derivatives[], size_t n)
REFUSED(GetEventIndicators, INSTANCE, fmi2Real indicators[], size_t n)
REFUSED(GetNominalsOfContinuousStates, INSTANCE, fmi2Real nominals[], size_t n)

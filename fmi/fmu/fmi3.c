/* SPDX-License-Identifier: Apache-2.0 */
/* The functions of FMI 3.0. Those of model exchange and scheduled execution, and those of co-simulation that the model
 * description does not offer, exist and refuse. */
#include "fmi/standard/fmi3.h"

#include "fmi/fmu/fmu.h"

#define DECLARED(name) FMU_EXPORT fmi3##name##TYPE fmi3##name;
FMI3_CO_SIMULATION(DECLARED)
FMI3_OTHER(DECLARED)
#undef DECLARED
FMU_ALIKE(fmi3, fmi3Instance, FMUState, Deserialize)

static void deliver(const Fmu *f, FmuStatus status, const char *category, const char *text)
{
    ((fmi3LogMessageCallback)f->logger)(f->environment, (fmi3Status)status, category, text);
}

const char *fmi3GetVersion(void)
{
    return "3.0";
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
                                         fmi3Boolean earlyReturnAllowed, const fmi3ValueReference intermediate[],
                                         size_t nIntermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const FmuSetup setup = {
        3,          name, token, resources, loggingOn, eventModeUsed, earlyReturnAllowed, deliver, (void (*)(void))log,
        environment};
    (void)visible;
    (void)intermediate;
    (void)nIntermediate;
    (void)intermediateUpdate;
    return fmu_new(&setup);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    return (fmi3Status)fmu_enter_initialization(instance, "fmi3EnterInitializationMode", startTime, stopTimeDefined,
                                                stopTime);
}

static fmi3Status change_phase(Fmu *f, const char *function, uint32_t from, FmuPhase to)
{
    if (!fmu_may(f, function, from)) {
        return fmi3Error;
    }
    if (f->moment->phase == FMU_EVENTS) {
        fmu_forget_ticks(f);
    }
    f->moment->phase = to;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    Fmu *f = instance;
    if (f != NULL && !f->event_mode) {
        return (fmi3Status)fmu_refuse(f, FMU_FAILED, "fmi3EnterEventMode",
                                      "the importer has not instantiated the FMU with eventModeUsed");
    }
    return change_phase(f, "fmi3EnterEventMode", FMU_STEPPING, FMU_EVENTS);
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return change_phase(instance, "fmi3EnterStepMode", FMU_EVENTS, FMU_STEPPING);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    return change_phase(instance, "fmi3Terminate", FMU_STEPPING | FMU_EVENTS, FMU_TERMINATED);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return fmu_may(instance, "fmi3EvaluateDiscreteStates", FMU_EVENTS) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *needUpdate, fmi3Boolean *terminate,
                                    fmi3Boolean *nominalsChanged, fmi3Boolean *statesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    *needUpdate = *terminate = *nominalsChanged = *statesChanged = *nextEventTimeDefined = false;
    *nextEventTime = 0.0;
    return change_phase(instance, "fmi3UpdateDiscreteStates", FMU_EVENTS, FMU_EVENTS);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentPoint, fmi3Float64 stepSize,
                      fmi3Boolean noSetStatePrior, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminate,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    Fmu *f = instance;
    const FmuStatus status = fmu_step(f, "fmi3DoStep", currentPoint, stepSize);
    (void)noSetStatePrior;
    *eventHandlingNeeded = *terminate = *earlyReturn = false;
    if (f != NULL) {
        *lastSuccessfulTime = f->moment->time;
    }
    if (status == FMU_DONE) {
        *eventHandlingNeeded = f->event_mode && fmu_any_ticked(f);
        *earlyReturn = f->moment->time < currentPoint + stepSize;
    }
    return (fmi3Status)status;
}

/* ---- variables. Booleans exist in no struct; enumerations are of 64 bits here. */

#define BIT(type) (1u << FLEDGE_##type)
#define ACCESS(name, kind, types)                                                                                      \
    fmi3Status fmi3Get##name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                   \
                             fmi3##name values[], size_t nValues)                                                      \
    {                                                                                                                  \
        const FmuCall call = {"fmi3Get" #name, FLEDGE_##kind, types, references, n, nValues};                          \
        return (fmi3Status)fmu_get(instance, &call, values);                                                           \
    }                                                                                                                  \
    fmi3Status fmi3Set##name(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                   \
                             const fmi3##name values[], size_t nValues)                                                \
    {                                                                                                                  \
        const FmuCall call = {"fmi3Set" #name, FLEDGE_##kind, types, references, n, nValues};                          \
        return (fmi3Status)fmu_set(instance, &call, values);                                                           \
    }
ACCESS(Float32, F32, BIT(F32))
ACCESS(Float64, F64, BIT(F64))
ACCESS(Int8, I8, BIT(I8))
ACCESS(UInt8, U8, BIT(U8))
ACCESS(Int16, I16, BIT(I16))
ACCESS(UInt16, U16, BIT(U16))
ACCESS(Int32, I32, BIT(I32))
ACCESS(UInt32, U32, BIT(U32))
ACCESS(Int64, I64, BIT(I64) | BIT(ENUM))
ACCESS(UInt64, U64, BIT(U64))
ACCESS(Boolean, U8, 0u)
ACCESS(String, CHAR, BIT(CHAR))

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t nValues)
{
    const FmuCall call = {"fmi3GetBinary", FLEDGE_U8, 0u, references, n, nValues};
    return (fmi3Status)fmu_get_packets(instance, &call, sizes, values);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t nValues)
{
    const FmuCall call = {"fmi3SetBinary", FLEDGE_U8, 0u, references, n, nValues};
    return (fmi3Status)fmu_set_packets(instance, &call, sizes, values);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Clock values[])
{
    const FmuCall call = {"fmi3GetClock", FLEDGE_U8, 0u, references, n, n};
    return (fmi3Status)fmu_get_clocks(instance, &call, values);
}

/* ---- what is not offered */

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define REFUSED(name, ...)                                                                                             \
    fmi3Status fmi3##name(__VA_ARGS__)                                                                                 \
    {                                                                                                                  \
        return (fmi3Status)fmu_refuse(instance, FMU_FAILED, "fmi3" #name, "this FMU does not offer it");               \
    }
#define INSTANCE fmi3Instance instance
#define REFERENCES INSTANCE, const fmi3ValueReference references[], size_t n
#define SENSITIVITY                                                                                                    \
    INSTANCE, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],                \
        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity

REFUSED(SetClock, REFERENCES, const fmi3Clock values[])
REFUSED(GetNumberOfVariableDependencies, INSTANCE, fmi3ValueReference dependent, size_t *n)
REFUSED(GetVariableDependencies, INSTANCE, fmi3ValueReference dependent, size_t dependentElements[],
        fmi3ValueReference independents[], size_t independentElements[], fmi3DependencyKind kinds[], size_t n)
REFUSED(GetDirectionalDerivative, SENSITIVITY)
REFUSED(GetAdjointDerivative, SENSITIVITY)
REFUSED(GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
REFUSED(EnterConfigurationMode, INSTANCE)
REFUSED(ExitConfigurationMode, INSTANCE)
REFUSED(GetIntervalDecimal, REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
REFUSED(GetIntervalFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
        fmi3IntervalQualifier qualifiers[])
REFUSED(GetShiftDecimal, REFERENCES, fmi3Float64 shifts[])
REFUSED(GetShiftFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
REFUSED(SetIntervalDecimal, REFERENCES, const fmi3Float64 intervals[])
REFUSED(SetIntervalFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
REFUSED(SetShiftDecimal, REFERENCES, const fmi3Float64 shifts[])
REFUSED(SetShiftFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

REFUSED(EnterContinuousTimeMode, INSTANCE)
REFUSED(CompletedIntegratorStep, INSTANCE, fmi3Boolean noSetStatePrior, fmi3Boolean *enterEventMode,
        fmi3Boolean *terminate)
REFUSED(SetTime, INSTANCE, fmi3Float64 time)
REFUSED(SetContinuousStates, INSTANCE, const fmi3Float64 states[], size_t n)
REFUSED(GetContinuousStates, INSTANCE, fmi3Float64 states[], size_t n)
REFUSED(GetContinuousStateDerivatives, INSTANCE, fmi3Float64 derivatives[], size_t n)
REFUSED(GetEventIndicators, INSTANCE, fmi3Float64 indicators[], size_t n)
REFUSED(GetNominalsOfContinuousStates, INSTANCE, fmi3Float64 nominals[], size_t n)
REFUSED(GetNumberOfEventIndicators, INSTANCE, size_t *n)
REFUSED(GetNumberOfContinuousStates, INSTANCE, size_t *n)
REFUSED(ActivateModelPartition, INSTANCE, fmi3ValueReference clock, fmi3Float64 time)

static void *no_instance(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, const char *text)
{
    if (log != NULL) {
        log(environment, fmi3Error, "errors", text);
    }
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean loggingOn, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    return no_instance(environment, log, "fmi3InstantiateModelExchange: this FMU is for co-simulation alone");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    return no_instance(environment, log, "fmi3InstantiateScheduledExecution: this FMU is for co-simulation alone");
}

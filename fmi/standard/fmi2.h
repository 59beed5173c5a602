/* SPDX-License-Identifier: Apache-2.0 */
/* The C interface of FMI 2.0, from the standard (fmi-standard.org): its types, and for each function its type, as
 * fmi2DoStepTYPE of fmi2DoStep. FMI2_CO_SIMULATION and FMI2_OTHER list all functions. */
#ifndef FMI_STANDARD_FMI2_H
#define FMI_STANDARD_FMI2_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define fmi2TypesPlatform "default"

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;

#define fmi2True 1
#define fmi2False 0

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;

typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                                   fmi2String category, fmi2String message, ...);
typedef void *(*fmi2CallbackAllocateMemory)(size_t n, size_t size);
typedef void (*fmi2CallbackFreeMemory)(void *memory);
typedef void (*fmi2StepFinished)(fmi2ComponentEnvironment environment, fmi2Status status);

typedef struct {
    fmi2CallbackLogger logger;
    fmi2CallbackAllocateMemory allocateMemory;
    fmi2CallbackFreeMemory freeMemory;
    fmi2StepFinished stepFinished;
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

/* Of both kinds of FMUs. */
typedef const char *fmi2GetTypesPlatformTYPE(void);
typedef const char *fmi2GetVersionTYPE(void);
typedef fmi2Status fmi2SetDebugLoggingTYPE(fmi2Component instance, fmi2Boolean on, size_t n,
                                           const fmi2String categories[]);
typedef fmi2Component fmi2InstantiateTYPE(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                          fmi2Boolean loggingOn);
typedef void fmi2FreeInstanceTYPE(fmi2Component instance);
typedef fmi2Status fmi2SetupExperimentTYPE(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                           fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime);
typedef fmi2Status fmi2EnterInitializationModeTYPE(fmi2Component instance);
typedef fmi2Status fmi2ExitInitializationModeTYPE(fmi2Component instance);
typedef fmi2Status fmi2TerminateTYPE(fmi2Component instance);
typedef fmi2Status fmi2ResetTYPE(fmi2Component instance);

/* The types of variables. */
#define FMI2_TYPES(X) X(Real) X(Integer) X(Boolean) X(String)
#define FMI2_ACCESS(type)                                                                                              \
    typedef fmi2Status fmi2Get##type##TYPE(fmi2Component instance, const fmi2ValueReference references[], size_t n,    \
                                           fmi2##type values[]);                                                       \
    typedef fmi2Status fmi2Set##type##TYPE(fmi2Component instance, const fmi2ValueReference references[], size_t n,    \
                                           const fmi2##type values[]);
FMI2_TYPES(FMI2_ACCESS)
#undef FMI2_ACCESS

typedef fmi2Status fmi2GetFMUstateTYPE(fmi2Component instance, fmi2FMUstate *state);
typedef fmi2Status fmi2SetFMUstateTYPE(fmi2Component instance, fmi2FMUstate state);
typedef fmi2Status fmi2FreeFMUstateTYPE(fmi2Component instance, fmi2FMUstate *state);
typedef fmi2Status fmi2SerializedFMUstateSizeTYPE(fmi2Component instance, fmi2FMUstate state, size_t *size);
typedef fmi2Status fmi2SerializeFMUstateTYPE(fmi2Component instance, fmi2FMUstate state, fmi2Byte bytes[], size_t size);
typedef fmi2Status fmi2DeSerializeFMUstateTYPE(fmi2Component instance, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state);
typedef fmi2Status fmi2GetDirectionalDerivativeTYPE(fmi2Component instance, const fmi2ValueReference unknowns[],
                                                    size_t nUnknowns, const fmi2ValueReference knowns[], size_t nKnowns,
                                                    const fmi2Real seed[], fmi2Real sensitivity[]);

/* Of model exchange. */
typedef fmi2Status fmi2EnterEventModeTYPE(fmi2Component instance);
typedef fmi2Status fmi2NewDiscreteStatesTYPE(fmi2Component instance, fmi2EventInfo *info);
typedef fmi2Status fmi2EnterContinuousTimeModeTYPE(fmi2Component instance);
typedef fmi2Status fmi2CompletedIntegratorStepTYPE(fmi2Component instance, fmi2Boolean noSetStatePrior,
                                                   fmi2Boolean *enterEventMode, fmi2Boolean *terminate);
typedef fmi2Status fmi2SetTimeTYPE(fmi2Component instance, fmi2Real time);
typedef fmi2Status fmi2SetContinuousStatesTYPE(fmi2Component instance, const fmi2Real states[], size_t n);
typedef fmi2Status fmi2GetDerivativesTYPE(fmi2Component instance, fmi2Real derivatives[], size_t n);
typedef fmi2Status fmi2GetEventIndicatorsTYPE(fmi2Component instance, fmi2Real indicators[], size_t n);
typedef fmi2Status fmi2GetContinuousStatesTYPE(fmi2Component instance, fmi2Real states[], size_t n);
typedef fmi2Status fmi2GetNominalsOfContinuousStatesTYPE(fmi2Component instance, fmi2Real nominals[], size_t n);

/* Of co-simulation. */
typedef fmi2Status fmi2SetRealInputDerivativesTYPE(fmi2Component instance, const fmi2ValueReference references[],
                                                   size_t n, const fmi2Integer orders[], const fmi2Real values[]);
typedef fmi2Status fmi2GetRealOutputDerivativesTYPE(fmi2Component instance, const fmi2ValueReference references[],
                                                    size_t n, const fmi2Integer orders[], fmi2Real values[]);
typedef fmi2Status fmi2DoStepTYPE(fmi2Component instance, fmi2Real currentPoint, fmi2Real stepSize,
                                  fmi2Boolean noSetStatePrior);
typedef fmi2Status fmi2CancelStepTYPE(fmi2Component instance);
typedef fmi2Status fmi2GetStatusTYPE(fmi2Component instance, const fmi2StatusKind kind, fmi2Status *value);
typedef fmi2Status fmi2GetRealStatusTYPE(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value);
typedef fmi2Status fmi2GetIntegerStatusTYPE(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer *value);
typedef fmi2Status fmi2GetBooleanStatusTYPE(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value);
typedef fmi2Status fmi2GetStringStatusTYPE(fmi2Component instance, const fmi2StatusKind kind, fmi2String *value);

// clang-format off
/** X(name) for each function fmi2NAME that an importer of co-simulation calls. */
#define FMI2_CO_SIMULATION(X) \
    X(GetTypesPlatform) X(GetVersion) X(SetDebugLogging) X(Instantiate) X(FreeInstance) \
    X(SetupExperiment) X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) X(Reset) \
    X(GetReal) X(GetInteger) X(GetBoolean) X(GetString) X(SetReal) X(SetInteger) X(SetBoolean) X(SetString) \
    X(GetFMUstate) X(SetFMUstate) X(FreeFMUstate) \
    X(SerializedFMUstateSize) X(SerializeFMUstate) X(DeSerializeFMUstate) X(GetDirectionalDerivative) \
    X(SetRealInputDerivatives) X(GetRealOutputDerivatives) X(DoStep) X(CancelStep) \
    X(GetStatus) X(GetRealStatus) X(GetIntegerStatus) X(GetBooleanStatus) X(GetStringStatus)

/** X(name) for each other function, of model exchange. */
#define FMI2_OTHER(X) \
    X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime) \
    X(SetContinuousStates) X(GetContinuousStates) X(GetDerivatives) X(GetEventIndicators) \
    X(GetNominalsOfContinuousStates)
// clang-format on

#ifdef __cplusplus
}
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* An instance of an FMU, for both versions of the standard: its states, variables, steps and memory over a system
 * (system.h). fmi2.c and fmi3.c are the functions of the standard over it. */
#ifndef FMI_FMU_FMU_H
#define FMI_FMU_FMU_H

#include "fmi/fmu/system.h"

#include <stdbool.h>
#include <stdlib.h>

#if defined _WIN32
#define FMU_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define FMU_EXPORT __attribute__((visibility("default")))
#else
#define FMU_EXPORT
#endif

/** Of a call. The numbers are those of fmi2Status and fmi3Status. */
typedef enum FmuStatus { FMU_DONE = 0, FMU_WARNED = 1, FMU_DISCARDED = 2, FMU_FAILED = 3 } FmuStatus;

/** The states of the standard: bits, so that a set of them is a number. In FMI 2.0, FMU_STEPPING is slaveInitialized,
 *  and FMU_TERMINATED also the error state. */
typedef enum FmuPhase {
    FMU_INSTANTIATED = 1,
    FMU_INITIALIZING = 2,
    FMU_STEPPING = 4,
    FMU_EVENTS = 8,
    FMU_TERMINATED = 16,
    FMU_ANY = 31
} FmuPhase;

/** What a saved state of the instance has beside the system's: this, and behind it the arrays of Fmu. */
typedef struct FmuMoment {
    int64_t now;        ///< [ns] of the mission
    double start, stop; ///< [s] of the importer
    double time;        ///< [s] of the importer: now
    uint32_t phase;     ///< an FmuPhase
    uint32_t computed;  ///< in the phase of initialization: the instant 0 has run since the last set
    uint32_t journal;   ///< [bytes] of the journal: parameters that were set since the last check, with their old bytes
    uint32_t bounded;   ///< `stop` counts
} FmuMoment;

/** Of a message: the importer has set a number of it since the last step; it has set its head at some time. */
enum { FMU_CHANGED = 1, FMU_OWN_HEAD = 2 };

typedef struct Fmu Fmu;

/** What calls the importer's logger. */
typedef void FmuDeliver(const Fmu *f, FmuStatus status, const char *category, const char *text);

struct Fmu {
    FmuHost host;
    FmuDeliver *deliver;
    void (*logger)(void); ///< the importer's, of the type of its version; NULL: none
    void *environment;    ///< the importer's
    int version;          ///< 2 or 3
    int event_mode, early_return;
    uint32_t categories; ///< that are logged, a bit each
    void *system;
    const FmuLayout *layout;
    int begun;       ///< the system's begin() has been called
    uint32_t number; ///< the last mode or count that was read
    FmuMoment *moment;
    size_t moment_size; ///< [bytes] with the arrays
    uint32_t *seen;     ///< of each process and event: how often a mode began or it fired, as the importer knows
    int32_t *request, *entered; ///< of each process: the mode that the importer has set, and that the system has got
    uint8_t *inputs;            ///< of each message: FMU_CHANGED and FMU_OWN_HEAD
    uint8_t *journal;
};

/** What the instance shall be. `resources` may end with a slash. */
typedef struct FmuSetup {
    int version;
    const char *name, *token, *resources;
    int logging, event_mode, early_return;
    FmuDeliver *deliver;
    void (*logger)(void);
    void *environment;
} FmuSetup;

/** A call that gets or sets values of n references. */
typedef struct FmuCall {
    const char *function; ///< its name, for the log
    FledgeType kind;      ///< of the importer's values
    uint32_t types;       ///< of variables that the function serves, a bit for each FledgeType
    const uint32_t *references;
    size_t n;
    size_t n_values;
} FmuCall;

/** A new instance; NULL: the logger has the reason. */
Fmu *fmu_new(const FmuSetup *setup);
void fmu_free(Fmu *f);
FmuStatus fmu_log_categories(Fmu *f, const char *function, int on, size_t n, const char *const *categories);

/** Log why a function fails, as printf does, and return the status. After FMU_FAILED the instance is terminated. */
FmuStatus fmu_refuse(Fmu *f, FmuStatus status, const char *function, const char *format, ...);
/** Whether a function may be called now; else it has failed. */
int fmu_may(Fmu *f, const char *function, uint32_t phases);

FmuStatus fmu_get(Fmu *f, const FmuCall *call, void *values);
FmuStatus fmu_set(Fmu *f, const FmuCall *call, const void *values);
/** Whether clocks have ticked since the last event mode. */
FmuStatus fmu_get_clocks(Fmu *f, const FmuCall *call, bool *values);
FmuStatus fmu_get_packets(Fmu *f, const FmuCall *call, size_t *sizes, const uint8_t **values);
FmuStatus fmu_set_packets(Fmu *f, const FmuCall *call, const size_t *sizes, const uint8_t *const *values);

/** Before a parameter is written: keep its old bytes. */
void fmu_remember(Fmu *f, const FmuVariable *v);
/** Check the parameters that were set since the last check; if a rule refuses them, all have their old values again. */
int fmu_check_parameters(Fmu *f);
/** Begin anew with all that was set, and run the instant 0. */
int fmu_begin(Fmu *f, const char *function);
/** In the phase of initialization: run the instant 0, if something was set since it ran. */
int fmu_compute(Fmu *f, const char *function);

FmuStatus fmu_enter_initialization(Fmu *f, const char *function, double start, int bounded, double stop);
FmuStatus fmu_exit_initialization(Fmu *f, const char *function);
/** From `time` [s] on by `step` [s]: to its end, or, if early return is allowed, to the first instant at which a clock
 *  ticked. FmuMoment::time is then where. */
FmuStatus fmu_step(Fmu *f, const char *function, double time, double step);
/** Whether clock i has ticked since fmu_forget_ticks(): those of the processes' modes, then those of events. */
int fmu_ticked(const Fmu *f, uint32_t i);
int fmu_any_ticked(const Fmu *f);
void fmu_forget_ticks(Fmu *f);
FmuStatus fmu_reset(Fmu *f, const char *function);

/** The state of the instance as allocated memory; *state, if not NULL, is used again. */
FmuStatus fmu_save(Fmu *f, const char *function, void **state);
FmuStatus fmu_restore(Fmu *f, const char *function, const void *state);
FmuStatus fmu_saved_size(Fmu *f, const char *function, const void *state, size_t *size);
FmuStatus fmu_write_saved(Fmu *f, const char *function, const void *state, void *bytes, size_t size);
FmuStatus fmu_read_saved(Fmu *f, const char *function, const void *bytes, size_t size, void **state);

/* ---- what FMI 2.0 and 3.0 have alike, with v for fmi2 or fmi3 */

#define FMU_ALIKE(v, Instance, State, Deserialize)                                                                     \
    v##Status v##SetDebugLogging(Instance instance, v##Boolean on, size_t n, const v##String categories[])             \
    {                                                                                                                  \
        return (v##Status)fmu_log_categories(instance, #v "SetDebugLogging", on, n, categories);                       \
    }                                                                                                                  \
    void v##FreeInstance(Instance instance)                                                                            \
    {                                                                                                                  \
        fmu_free(instance);                                                                                            \
    }                                                                                                                  \
    v##Status v##ExitInitializationMode(Instance instance)                                                             \
    {                                                                                                                  \
        return (v##Status)fmu_exit_initialization(instance, #v "ExitInitializationMode");                              \
    }                                                                                                                  \
    v##Status v##Reset(Instance instance)                                                                              \
    {                                                                                                                  \
        return (v##Status)fmu_reset(instance, #v "Reset");                                                             \
    }                                                                                                                  \
    v##Status v##Get##State(Instance instance, v##State *state)                                                        \
    {                                                                                                                  \
        return (v##Status)fmu_save(instance, #v "Get" #State, state);                                                  \
    }                                                                                                                  \
    v##Status v##Set##State(Instance instance, v##State state)                                                         \
    {                                                                                                                  \
        return (v##Status)fmu_restore(instance, #v "Set" #State, state);                                               \
    }                                                                                                                  \
    v##Status v##Free##State(Instance instance, v##State *state)                                                       \
    {                                                                                                                  \
        (void)instance;                                                                                                \
        if (state != NULL) {                                                                                           \
            free(*state);                                                                                              \
            *state = NULL;                                                                                             \
        }                                                                                                              \
        return v##OK;                                                                                                  \
    }                                                                                                                  \
    v##Status v##Serialized##State##Size(Instance instance, v##State state, size_t *size)                              \
    {                                                                                                                  \
        return (v##Status)fmu_saved_size(instance, #v "Serialized" #State "Size", state, size);                        \
    }                                                                                                                  \
    v##Status v##Serialize##State(Instance instance, v##State state, v##Byte bytes[], size_t size)                     \
    {                                                                                                                  \
        return (v##Status)fmu_write_saved(instance, #v "Serialize" #State, state, bytes, size);                        \
    }                                                                                                                  \
    v##Status v##Deserialize##State(Instance instance, const v##Byte bytes[], size_t size, v##State *state)            \
    {                                                                                                                  \
        return (v##Status)fmu_read_saved(instance, #v #Deserialize #State, bytes, size, state);                        \
    }

#endif

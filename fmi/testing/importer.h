/* SPDX-License-Identifier: Apache-2.0 */
/* A small importer of FMUs for co-simulation, 2.0 and 3.0, in C99: for tests, independent of fmi/importer. A function
 * that fails returns -1, or null, and has written a line to stderr. */
#ifndef FMI_TESTING_IMPORTER_H
#define FMI_TESTING_IMPORTER_H

#include "flight/exec/element.h"
#include "fmi/standard/fmi2.h"
#include "fmi/standard/fmi3.h"

/** n elements from a value reference on: an array in 3.0, scalars in 2.0. The type is that of Fledge; of FLEDGE_CHAR, n
 *  is the room for a text [bytes]. */
typedef struct ImporterVariable {
    uint32_t reference, n;
    FledgeType type;
} ImporterVariable;

#define IMPORTER_FUNCTION2(name) fmi2##name##TYPE *name;
#define IMPORTER_FUNCTION3(name) fmi3##name##TYPE *name;

/** An instance of an FMU; it must not move. */
typedef struct ImporterFmu {
    int version; ///< 2 or 3
    const char *library, *name, *token, *resources;
    int events;                                            ///< of 3.0: with event mode and early return
    void (*at_event)(void *user, struct ImporterFmu *fmu); ///< in event mode, or null
    void *user;
    double t;                           ///< [s] of the FMU
    int terminated;                     ///< it has ended the simulation
    uint32_t early, discarded, handled; ///< steps that were cut, and event modes
    void *handle, *instance;
    struct {
        FMI2_CO_SIMULATION(IMPORTER_FUNCTION2)
    } two;
    struct {
        FMI3_CO_SIMULATION(IMPORTER_FUNCTION3)
    } three;
    fmi2CallbackFunctions callbacks;
} ImporterFmu;

/** A state: the FMU's own, and its bytes. */
typedef struct ImporterState {
    void *held;
    double t;
    size_t size;
    unsigned char *bytes;
} ImporterState;

/** Load the library and make an instance, by the members up to `user`; all others are zero. */
int importer_open(ImporterFmu *fmu);
void importer_close(ImporterFmu *fmu);
int importer_begin(ImporterFmu *fmu, double start); ///< initialization mode
int importer_begun(ImporterFmu *fmu);               ///< leave it
/** Step to a time, by as many shorter steps as the FMU wants. */
int importer_step(ImporterFmu *fmu, double until);
int importer_reset(ImporterFmu *fmu);
int importer_end(ImporterFmu *fmu);

/** The values as Fledge's elements, one behind the other. */
int importer_get(ImporterFmu *fmu, ImporterVariable v, void *values);
int importer_set(ImporterFmu *fmu, ImporterVariable v, const void *values);
int importer_ticked(ImporterFmu *fmu, uint32_t clock); ///< 1: a clock is active, in event mode

int importer_save(ImporterFmu *fmu, ImporterState *state);
/** Go back to a state; `serialised`: by its bytes, which may be those of another instance. */
int importer_restore(ImporterFmu *fmu, const ImporterState *state, int serialised);
int importer_forget(ImporterFmu *fmu, ImporterState *state);

/** [bytes] of the elements of a variable. */
static inline size_t importer_bytes(ImporterVariable v)
{
    return (size_t)v.n * element_size(v.type);
}

#endif

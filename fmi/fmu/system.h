/* SPDX-License-Identifier: Apache-2.0 */
/* What an FMU flies, behind the functions of the standard (fmi2.c, fmi3.c): variables, time and state. An exported
 * mission (mission.h), a simulation and the emulated computer each are such a system; a library has one of them.
 *
 * Time is that of the mission [ns], from 0 at the start. The system runs the instant 0 in begin(), and in advance() all
 * instants after the last one up to the given time. At an instant, inputs are what the importer has set until then.
 *
 * Example:
 *     const FmuHost host = {NULL, NULL, "craft", "", ""};
 *     void *craft = fmu_system.create(&host);
 *     int64_t reached;
 *     if (craft != NULL && fmu_system.begin(craft) == 0 &&
 *         fmu_system.advance(craft, 500000000, 0, &reached) == 0) {
 *         fmu_system.destroy(craft);
 *     } */
#ifndef FMI_FMU_SYSTEM_H
#define FMI_FMU_SYSTEM_H

#include "flight/exec/element.h"

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum FmuRole {
    FMU_INPUT,       ///< a field of a message that comes from outside
    FMU_OUTPUT,      ///< a field of a message that is read outside
    FMU_LOCAL,       ///< a field of any other message
    FMU_PARAMETER,   ///< may change between two steps
    FMU_FIXED,       ///< a parameter that counts at the start alone
    FMU_MODE,        ///< the mode in force of the process `block`, from 1
    FMU_REQUEST,     ///< the mode that the process `block` shall enter, from 1; 0: none. An input
    FMU_FIRED,       ///< how often the event `block` has fired
    FMU_CLOCK_MODE,  ///< ticks when a mode of the process `block` begins
    FMU_CLOCK_EVENT, ///< ticks when the event `block` fires
    FMU_TIME,        ///< the importer's time [s], FLEDGE_F64
    FMU_UPLINK,      ///< packets to flight, whole and one after the other; FMI 3.0 alone has the type
    FMU_DOWNLINK     ///< the packets that flight sent in the last step, likewise
} FmuRole;

/** A variable: an array of n elements in a block of memory. Its value reference in FMI 3.0 is `reference`; in FMI 2.0,
 *  which has no arrays, its elements have the references from `reference` on, a text one. References rise from 0
 *  without gaps. */
typedef struct FmuVariable {
    uint32_t reference;
    FmuRole role;
    FledgeType type; ///< of an element; FLEDGE_CHAR: the variable is one text of at most n - 1 characters
    uint32_t n;
    uint32_t block;  ///< of FmuSystem::memory; else see FmuRole
    uint32_t offset; ///< [bytes] in the block
} FmuVariable;

/** A message that comes from outside. If the importer never sets its head, the FMU gives it one for each step before
 *  which a number of it was set: of that time, and good. */
typedef struct FmuMessage {
    uint32_t first, n; ///< its variables
    uint32_t block;
    uint32_t offset; ///< [bytes] of its Head
} FmuMessage;

typedef struct FmuLayout {
    const FmuVariable *variables; ///< by reference
    uint32_t n;
    const FmuMessage *messages; ///< inputs
    uint32_t n_messages;
    uint32_t n_processes; ///< that have modes
    uint32_t n_events;
} FmuLayout;

typedef enum FmuSeverity { FMU_OK, FMU_WARNING, FMU_ERROR } FmuSeverity;

/** What a system may use of its instance. Categories are "modes", "events", "commands", "console", "warnings",
 *  "errors". */
typedef struct FmuHost {
    void *user;
    void (*log)(void *user, FmuSeverity severity, const char *category, const char *text);
    const char *instance;  ///< its name
    const char *token;     ///< that the importer gave
    const char *resources; ///< the folder of the FMU's resources, without a slash at the end; "" if there is none
} FmuHost;

/** All functions that can fail return 0, or -1 after they have said why to the log. No function keeps anything outside
 *  of `self`. */
typedef struct FmuSystem {
    const char *token; ///< of the model description (instantiationToken, guid); NULL: token.txt of the resources has it
    /** A new system, with the parameters of the mission; NULL: it said why. The host outlives it. */
    void *(*create)(const FmuHost *host);
    void (*destroy)(void *self);
    const FmuLayout *(*layout)(const void *self);
    void *(*memory)(void *self, uint32_t block);
    /** Parameters of the block were written since the last call: check them by the rules of their headers. */
    int (*changed)(void *self, uint32_t block);
    /** Begin anew at 0 with the present parameters and inputs, and run the instant 0. */
    int (*begin)(void *self);
    /** Run until a time. With `stop`, stop at the first instant at which a mode changed or an event fired; *reached is
     *  where. */
    int (*advance)(void *self, int64_t until, int stop, int64_t *reached);
    int32_t (*mode)(const void *self, uint32_t process); ///< from 0; -1: none
    int (*enter)(void *self, uint32_t process, int32_t mode);
    uint32_t (*fired)(const void *self, uint32_t event);     ///< how often, since begin()
    uint32_t (*entered)(const void *self, uint32_t process); ///< how often a mode began, since begin()
    size_t (*state_size)(void *self);                        ///< [bytes] of a state that is saved now; after begin()
    int (*save)(void *self, void *bytes);
    int (*restore)(void *self, const void *bytes, size_t size); ///< after begin(); refuses bytes of another system
    /** NULL where the system has no packets. Those of uplink() act at the next instant, and are a part of the state
     *  until then; downlink() returns the n bytes that the last advance() or begin() sent. */
    int (*uplink)(void *self, const uint8_t *packets, size_t n);
    const uint8_t *(*downlink)(const void *self, size_t *n);
} FmuSystem;

extern const FmuSystem fmu_system; ///< of this library

#ifdef __cplusplus
}
#endif

#endif

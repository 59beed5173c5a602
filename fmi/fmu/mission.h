/* SPDX-License-Identifier: Apache-2.0 */
/* An exported mission (targets/mission.h) as the system of an FMU. `fledge export fmu` writes the data (MISSION_fmu.c).
 *
 * The importer writes the inputs of flight into the mission's memory; their latency is its own matter. A parameter that
 * it sets counts from flight's next instant on, as do a mode that it requests and packets that it sends. If the
 * computer has a line of reset, each new count on it begins flight anew, with the parameters of the start. */
#ifndef FMI_FMU_MISSION_H
#define FMI_FMU_MISSION_H

#include "flight/telemetry/telemetry.h"
#include "fmi/fmu/system.h"
#include "targets/mission.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FMU_NO_RESET = -1 };

typedef struct FmuMission {
    const FmuLayout *layout; ///< its blocks of memory: those of parameters, then the messages
    size_t size;             ///< [bytes] of the mission's struct
    size_t inputs;           ///< [bytes] where its messages from outside begin
    size_t inputs_size;      ///< [bytes]
    void (*init)(void *mission);
    void (*restart)(void *mission, int64_t t);
    int64_t (*next)(const void *mission);
    void (*tick)(void *mission, int64_t t);
    const CommandTable *commands; ///< it and the next ones are patterns: each instance has memory of its own
    const TelemetryTable *telemetry;
    const CommandServices *services; ///< NULL: none
    size_t staged;                   ///< [bytes] of the largest block of parameters
    size_t packet;                   ///< [bytes] of the largest packet of telemetry
    const char *const *modes;        ///< their names
    const char *const *event_names;
    const size_t *events; ///< [bytes] where each ExecEvent is
    const MissionMessage *messages;
    const MissionParameters *parameters;
    int64_t reset; ///< [bytes] where the ComputerReset is by which the outside resets the computer, or FMU_NO_RESET
    int64_t down;  ///< [ns] how long the computer is down after it
} FmuMission;

extern const FmuMission fmu_mission; ///< of this library
extern const char fmu_token[];       ///< of its model description

#ifdef __cplusplus
}
#endif

#endif

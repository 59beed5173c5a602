/* SPDX-License-Identifier: Apache-2.0 */
/* What the FMU of flight on an emulated computer knows of the mission: a shared object beside its library, which
 * `fledge export fmu --on leon3` builds.
 *
 * Example:
 *
 *     const TelemetryTable *telemetry = fmu_board.host->telemetry;
 *     uint32_t read = fmu_board.n_parts; // after each instant, of the memory of the mission
 *     read += fmu_board.host->commands->n_blocks + telemetry->n_outputs;
 */
#ifndef FMI_BOARD_BOARD_H
#define FMI_BOARD_BOARD_H

#include "fmi/fmu/system.h"
#include "targets/mission_host.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct FmuBoard {
    const MissionHost *host;
    const FmuLayout *layout;             ///< its blocks of memory: those of parameters, then the messages
    const MissionParameters *parameters; ///< in the order of the commands' blocks
    const TelemetryOutput *parts; ///< of its memory, besides outputs and parameters: the mode, the events, and the
                                  ///< inputs to which a change of the configuration is published
    uint32_t n_parts;
    uint32_t size; ///< [bytes] of the mission's struct
} FmuBoard;

extern const FmuBoard fmu_board;

#ifdef __cplusplus
}
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* What every exported mission includes: the rules of time, and how it lists its messages and
 * parameters for its host. */
#ifndef TARGETS_MISSION_H
#define TARGETS_MISSION_H

#include "flight/exec/event.h"
#include "flight/exec/message.h"
#include "flight/exec/task.h"

typedef enum MissionDirection {
    MISSION_IN = 0,    ///< the host fills it before a tick
    MISSION_OUT = 1,   ///< a reader outside flight is wired to it
    MISSION_INSIDE = 2 ///< an output without a reader outside flight; for records
} MissionDirection;

/** A message of the mission; its id is its place in the mission's list. */
typedef struct MissionMessage {
    const char *path; ///< of the output that it is: "world.nav.attitude", "flight.motor.command"
    const char *type; ///< "NavAttitude"
    uint32_t offset;  ///< [bytes] in the mission's struct
    uint32_t size;    ///< [bytes]
    MissionDirection direction;
} MissionMessage;

/** The parameters of a module: one block of bytes, without padding. */
typedef struct MissionParameters {
    const char *path; ///< of the module: "flight.control"
    const char *type; ///< "MrpFeedback"
    uint32_t offset;  ///< [bytes] in the mission's struct
    uint32_t size;    ///< [bytes]
} MissionParameters;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Every exported mission includes this header: the rules of time, and the types of its lists of messages and
 * parameters. */
#ifndef TARGETS_MISSION_H
#define TARGETS_MISSION_H

#include "flight/exec/event.h"
#include "flight/exec/message.h"
#include "flight/exec/task.h"

typedef enum MissionDirection {
    MISSION_IN = 0,    ///< an input: the host writes it before a tick
    MISSION_OUT = 1,   ///< an output with a reader outside flight
    MISSION_INSIDE = 2 ///< any other output, for records
} MissionDirection;

/** A message of the mission. Its id is its index in the mission's list. */
typedef struct MissionMessage {
    const char *path; ///< of its output: "world.nav.attitude", "flight.motor.command"
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

/** Of a host that runs each task in a thread of its own (`fledge export rtems`): run the task with this index, and
 *  return when it has run. */
void mission_run_task(uint32_t task, void (*run)(void *mission, Tick t), void *mission, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Slews: turns of the body from one attitude to another, and how they stand. */
#ifndef FLIGHT_MSG_SLEW_H
#define FLIGHT_MSG_SLEW_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** What a slew profile does. */
typedef enum SlewPhase {
    SLEW_NONE = 0,    ///< there is no reference yet
    SLEW_SLEWING = 1, ///< on the way to the target
    SLEW_TRACKING = 2 ///< the reference is the target
} SlewPhase;

/** How a slew stands. */
typedef struct SlewStatus {
    Head head;
    double remaining; ///< [s]     until the reference is the target
    double angle;     ///< [rad]   that is left of the turn about the eigenaxis
    double peak;      ///< [rad/s] largest rate about the eigenaxis, as planned
    SlewPhase phase;
    uint32_t slews; ///< [-] that have begun, since the reset
} SlewStatus;

/** What becomes of a target, with its way. */
typedef enum KeepOutResult {
    KEEP_OUT_NONE = 0,          ///< nothing is known yet
    KEEP_OUT_CLEAR = 1,         ///< the turn about the eigenaxis is free
    KEEP_OUT_DETOUR = 2,        ///< by way-points
    KEEP_OUT_TARGET_INSIDE = 3, ///< refused: the target itself is inside a cone
    KEEP_OUT_START_INSIDE = 4,  ///< the body is inside a cone, on a way that goes no deeper where there is one
    KEEP_OUT_NO_PATH = 5        ///< refused: no way was found
} KeepOutResult;

/** How a target and its way stand to the cones that are kept out of. */
typedef struct KeepOutStatus {
    Head head;
    double clearance; ///< [rad] of the nearest boresight from a cone, on the way that is left; negative: inside
    double length;    ///< [rad] the sum of the turns that are left
    double direct;    ///< [rad] the turn to the target about the eigenaxis
    KeepOutResult result;
    uint32_t points; ///< [-] way-points that are left
    uint32_t plans;  ///< [-] ways that were searched for, since the reset
    uint32_t spare;
} KeepOutStatus;

#endif

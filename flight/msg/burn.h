/* SPDX-License-Identifier: Apache-2.0 */
/* Changes of the orbit by engines. */
#ifndef FLIGHT_MSG_BURN_H
#define FLIGHT_MSG_BURN_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** A change of velocity. The direction of thrust at its start is that of dv_N; from then on, and before, it turns at a
 *  rate that is constant in N. */
typedef struct DeltaVCommand {
    Head head;
    int64_t start; ///< [ns] when the engines start
    Vec3 dv_N;     ///< [m/s] N components
    Vec3 rate_N;   ///< [rad/s] at which the direction turns, N components; 0: it rests
} DeltaVCommand;

/** The velocity that the engines and all else but gravity have added. */
typedef struct DeltaVSum {
    Head head;
    Vec3 dv_N;     ///< [m/s]   since the start of the sum, N components
    double path;   ///< [m/s]   integral of the size of the acceleration
    Vec3 a_N;      ///< [m/s^2] acceleration now, N components
    int64_t start; ///< [ns]    of the sum
} DeltaVSum;

/** What a burn is doing. */
typedef enum BurnPhase {
    BURN_NONE = 0,     ///< no burn was commanded
    BURN_WAITS = 1,    ///< for its start, or for the attitude
    BURN_RUNS = 2,     ///< the engines are open
    BURN_COMPLETE = 3, ///< cut off at the commanded change
    BURN_ABORTED = 4,  ///< cut off without it, or never begun
    BURN_CUT = 5       ///< of BurnMemory: cut off by a reset; it may go on
} BurnPhase;

/** Why a burn was aborted. */
typedef enum BurnAbort {
    BURN_NOT_ABORTED = 0,
    BURN_TOO_LONG = 1,  ///< it ran for the longest time allowed
    BURN_OFF_POINT = 2, ///< the attitude error was too large, or unknown
    BURN_BLIND = 3,     ///< the acceleration was not known for too long
    BURN_NO_THRUST = 4, ///< the acceleration was too small for too long
    BURN_LATE = 5,      ///< its start was too long ago when it could have begun
    BURN_LEFT = 6       ///< of BurnMemory: flight left the mode in which it ran
} BurnAbort;

/** Where a burn stands. */
typedef struct BurnState {
    Head head;
    BurnPhase phase;
    BurnAbort abort;
    double gained; ///< [m/s] along the commanded direction
    double to_go;  ///< [m/s] of the commanded size
    int64_t start; ///< [ns] of the command
    int64_t begun; ///< [ns] when the engines opened; 0: not yet
    int64_t ended; ///< [ns] when they close or have closed; 0: not yet known
} BurnState;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* How a plan of the wheels' speeds stands. */
#ifndef FLIGHT_MSG_WHEEL_PLAN_H
#define FLIGHT_MSG_WHEEL_PLAN_H

#include "flight/msg/wheels.h"

/** What the null motion of the wheels can do for their speeds. */
typedef enum WheelPlanPhase {
    WHEEL_PLAN_NONE = 0,    ///< nothing: the available wheels have no null motion
    WHEEL_PLAN_HOLDS = 1,   ///< all wheels can keep the directions in which they turn
    WHEEL_PLAN_CROSSES = 2, ///< wheels are on their way through zero
    WHEEL_PLAN_BOUND = 3    ///< it cannot keep all wheels out of the band and within the largest speed
} WheelPlanPhase;

/** How the speeds of the available wheels stand. */
typedef struct WheelPlanState {
    Head head;
    double margin;        ///< [-] 1 - |Omega| / Omega_max of the fastest wheel, now; negative: it is too fast
    double margin_wanted; ///< [-] the same of the wanted speeds: what null motion cannot better
    WheelPlanPhase phase;
    uint32_t in_band;   ///< [-] wheels that are slower than Omega_min, now
    uint32_t crossing;  ///< [-] wheels that shall turn the other way than now
    uint32_t crossings; ///< [-] wheels that were commanded to do so, since the reset
} WheelPlanState;

#endif

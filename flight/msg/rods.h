/* SPDX-License-Identifier: Apache-2.0 */
/* What modules that drive torque rods say of themselves. */
#ifndef FLIGHT_MSG_RODS_H
#define FLIGHT_MSG_RODS_H

#include "flight/msg/head.h"

/** How rods and magnetometer take turns. */
typedef struct RodWindowState {
    Head head;
    double share;   ///< [-] of the last period in which the rods were on; in the first one: what is wanted
    uint32_t on;    ///< [-] in [0, 1]: 1: the rods act now
    uint32_t taken; ///< [-] measurements of the field that were taken
} RodWindowState;

/** How a tumble ends. */
typedef struct DetumbleState {
    Head head;
    double rate;        ///< [rad/s] of the body by the gyro; without a gyro, that across the field
    double slow_for;    ///< [s] how long it is below its threshold
    uint32_t detumbled; ///< [-] in [0, 1]: 1: it is so for long enough
    uint32_t gyro;      ///< [-] in [0, 1]: 1: the rate is that of the gyro
} DetumbleState;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_MSG_VOLTS_H
#define FLIGHT_MSG_VOLTS_H

#include "flight/msg/wheels.h"

/** The voltages at the motors of the wheels, where no converter stands between. */
typedef struct WheelVolts {
    Head head;
    double volts[WHEELS_MAX]; ///< [V] of each motor
} WheelVolts;

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Thrusters that are switched on and off; for burns of a given duration, ThrusterTimes (avionics.h). */
#ifndef FLIGHT_MSG_VALVES_H
#define FLIGHT_MSG_VALVES_H

#include "flight/msg/avionics.h"

/** Which thrusters shall be open until the next message. */
typedef struct ThrusterValves {
    Head head;
    uint8_t open[THRUSTERS_MAX]; ///< [-] in [0, 1]: 1: open
} ThrusterValves;

#endif

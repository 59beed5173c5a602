/* SPDX-License-Identifier: Apache-2.0 */
/* Thrusters: their set, availability and wanted forces. When they are open, ThrusterTimes says (avionics.h). */
#ifndef FLIGHT_MSG_THRUSTERS_H
#define FLIGHT_MSG_THRUSTERS_H

#include "flight/math/vec.h"
#include "flight/msg/avionics.h"
#include "flight/msg/head.h"

/** The thrusters of the vehicle: the first n entries count. */
typedef struct ThrusterSet {
    Head head;
    uint32_t n; ///< [-] in [0, 8]: number of thrusters
    uint32_t spare;
    Vec3 r_TC_B[THRUSTERS_MAX];  ///< [m] count n: where each acts, relative to the centre of mass, B components
    Vec3 axes_B[THRUSTERS_MAX];  ///< [-] count n: unit direction of its force on the body
    double F_max[THRUSTERS_MAX]; ///< [N] count n, >= 0: its force while it is open
} ThrusterSet;

/** The number of thrusters, also where a message holds more than there is room for. */
static inline uint32_t thrusters_count(const ThrusterSet *thrusters)
{
    return thrusters->n < THRUSTERS_MAX ? thrusters->n : THRUSTERS_MAX;
}

/** Which thrusters may be used now. */
typedef struct ThrusterAvailability {
    Head head;
    uint8_t available[THRUSTERS_MAX]; ///< [-] in [0, 1]: 1 if the thruster may be used
} ThrusterAvailability;

/** The mean force that each thruster shall give until the next message. */
typedef struct ThrusterForces {
    Head head;
    double F[THRUSTERS_MAX]; ///< [N] >= 0: along its direction
} ThrusterForces;

/** A force on the body. */
typedef struct BodyForce {
    Head head;
    Vec3 force_B; ///< [N] force at the centre of mass, B components
} BodyForce;

#endif

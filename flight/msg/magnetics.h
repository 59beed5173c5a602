/* SPDX-License-Identifier: Apache-2.0 */
/* The magnetic field, and the torque rods that act on it. */
#ifndef FLIGHT_MSG_MAGNETICS_H
#define FLIGHT_MSG_MAGNETICS_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

#define RODS_MAX 8

/** The magnetic field at the spacecraft, as a magnetometer measures it. */
typedef struct MeasuredField {
    Head head;
    Vec3 B_B; ///< [T] flux density, B components
} MeasuredField;

/** The magnetic field at the spacecraft, as a model on board knows it. */
typedef struct KnownField {
    Head head;
    Vec3 B_N; ///< [T] flux density, N components
} KnownField;

/** A magnetic dipole of the body. */
typedef struct BodyDipole {
    Head head;
    Vec3 dipole_B; ///< [A m^2] B components
} BodyDipole;

/** The torque rods of the vehicle: the first n entries count. */
typedef struct RodSet {
    Head head;
    uint32_t n; ///< [-] in [0, 8]: number of rods
    uint32_t spare;
    Vec3 axes_B[RODS_MAX];  ///< [-]     count n: unit directions of positive dipoles
    double m_max[RODS_MAX]; ///< [A m^2] count n, >= 0: largest dipole; 0: unlimited
} RodSet;

/** The number of rods, also where a message holds more than there is room for. */
static inline uint32_t rods_count(const RodSet *rods)
{
    return rods->n < RODS_MAX ? rods->n : RODS_MAX;
}

/** The dipoles of the rods. */
typedef struct RodCommand {
    Head head;
    double dipole[RODS_MAX]; ///< [A m^2] of each rod along its axis
} RodCommand;

#endif

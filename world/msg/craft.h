/* SPDX-License-Identifier: Apache-2.0 */
/* The true state of a spacecraft, and what acts on it.
 *
 * Example:
 *
 *     CraftState truth = {.r_BN_N = {{6878137.0, 0.0, 0.0}}, .v_BN_N = {{0.0, 7612.6, 0.0}}};
 *     truth.head = head_next(truth.head, 0, QUALITY_GOOD);
 *     const ForceTorque push = {.head = truth.head, .force_B = {{0.01, 0.0, 0.0}}};
 */
#ifndef WORLD_MSG_CRAFT_H
#define WORLD_MSG_CRAFT_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** The true motion of a spacecraft. */
typedef struct CraftState {
    Head head;
    Vec3 r_BN_N;      ///< [m]       position of the body's origin relative to the origin of N
    Vec3 v_BN_N;      ///< [m/s]     its velocity relative to N
    Vec3 sigma_BN;    ///< [-]       attitude of B relative to N, |sigma| <= 1
    Vec3 omega_BN_B;  ///< [rad/s]   angular rate of B relative to N, B components
    Vec3 domega_BN_B; ///< [rad/s^2] its derivative, B components
    Vec3 a_BN_N;      ///< [m/s^2]   acceleration of the body's origin relative to N
    Vec3 r_CN_N;      ///< [m]       position of the centre of mass relative to the origin of N
    Vec3 v_CN_N;      ///< [m/s]     its velocity relative to N
    Vec3 g_CN_N;      ///< [m/s^2]   acceleration of the centre of mass by gravity
} CraftState;

/** A force and a torque on a spacecraft, held until the next message. */
typedef struct ForceTorque {
    Head head;
    Vec3 force_N;  ///< [N]   force at the centre of mass, N components
    Vec3 force_B;  ///< [N]   force at the centre of mass, B components
    Vec3 torque_B; ///< [N m] torque about the centre of mass, B components
} ForceTorque;

#endif

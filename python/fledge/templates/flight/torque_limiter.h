/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_TORQUE_LIMITER_H
#define FLIGHT_TORQUE_LIMITER_H

#include "flight/msg/vehicle.h"

/** Limit how fast a torque changes. Replace this example: describe the module here, and give the
 *  source of its equations. Python, records and plots know the module from this struct alone: its
 *  input and output messages, its parameters with their units and limits (`required`, `> 0`,
 *  `in [0, 1]`), and in `mem` its state from one update to the next. */
typedef struct TorqueLimiter {
    struct {
        BodyTorque wanted;
    } in;
    struct {
        BodyTorque torque; ///< the wanted torque, or a step towards it
    } out;
    struct {
        double rate; ///< [N m / s] required, > 0: how much the torque may change per time
    } par;
    struct {
        Vec3 torque_B; ///< [N m] the torque at the last update
    } mem;
} TorqueLimiter;

void torque_limiter_reset(TorqueLimiter *m);
void torque_limiter_update(TorqueLimiter *m, Tick t);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_TORQUE_LIMITER_H
#define FLIGHT_TORQUE_LIMITER_H

#include "flight/msg/vehicle.h"

/** Limit how fast a torque changes. This is an example to be replaced: say here what the module
 *  does, and where the equations come from. What follows is all that Python, records and plots know
 *  of it: the messages that it takes and gives, parameters with their units and limits (`required`,
 *  `> 0`, `in [0, 1]`), and in `mem` what it remembers from one update to the next. */
typedef struct TorqueLimiter {
    struct {
        BodyTorque wanted;
    } in;
    struct {
        BodyTorque torque; ///< the wanted one, or on its way there
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

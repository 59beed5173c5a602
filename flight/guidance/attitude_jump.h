/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/guidance: whether a reference continues its motion, or another one has taken its place. */
#ifndef FLIGHT_GUIDANCE_ATTITUDE_JUMP_H
#define FLIGHT_GUIDANCE_ATTITUDE_JUMP_H

#include "flight/math/attitude.h"
#include "flight/msg/attitude.h"

/** [rad] The angle between `now` and where `before` would have turned until then, by its rate and acceleration. */
static inline double attitude_jump(const AttReference *before, const AttReference *now)
{
    const double age = tick_seconds(tick_since(now->head.t, before->head.t));
    const Vec3 gained = vec_scale(age, before->domega_RN_N);
    const Vec3 phi = vec_scale(age, vec_add(before->omega_RN_N, vec_scale(0.5, gained)));
    return mrp_angle(mrp_relative(now->sigma_RN, mrp_compose(before->sigma_RN, mrp_turn(phi))));
}

#endif

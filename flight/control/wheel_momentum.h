/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/control: what laws for the body's torque share. */
#ifndef FLIGHT_CONTROL_WHEEL_MOMENTUM_H
#define FLIGHT_CONTROL_WHEEL_MOMENTUM_H

#include "flight/msg/wheels.h"

/** [N m s] sum of h_i g_i with h_i = J_i (omega_BN . g_i + Omega_i), thesis Eq. (A.3), B components. */
static inline Vec3 wheel_momentum(const WheelSet *wheels, const WheelSpeeds *speeds, Vec3 omega_BN_B)
{
    Vec3 momentum = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < wheels_count(wheels); i++) {
        Vec3 axis = wheels->axes_B[i];
        double h = wheels->J[i] * (vec_dot(omega_BN_B, axis) + speeds->Omega[i]);
        momentum = vec_add(momentum, vec_scale(h, axis));
    }
    return momentum;
}

/** The quality of a torque by an error, the vehicle's data, the external torque and, as far as they are wired, the
 *  wheels. Wheels whose speeds are unknown degrade it. */
static inline Quality torque_quality(Head error, Head vehicle, Head external, Head wheels, Head speeds)
{
    Quality quality = quality_min(quality_through(error), quality_through(vehicle));
    quality = quality_min(quality, quality_optional(external));
    quality = quality_min(quality, quality_optional(wheels));
    if (head_written(wheels)) {
        quality = quality_min(quality, head_written(speeds) ? quality_through(speeds) : QUALITY_DEGRADED);
    }
    return quality;
}

#endif

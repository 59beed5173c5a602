/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/control: what laws for the body's torque share. */
#ifndef FLIGHT_CONTROL_WHEEL_MOMENTUM_H
#define FLIGHT_CONTROL_WHEEL_MOMENTUM_H

#include "flight/msg/wheels.h"

/** The integral of an error: it grows by the trapezoid between the last error, if there is one, and that of now. The
 *  limit on it, not on the torque alone, is the anti-windup. */
static inline Vec3 error_integral(Vec3 z, int running, Vec3 last, Vec3 now, Tick t, double K_I, double u_I_max)
{
    if (!(K_I > 0.0)) {
        return vec3(0.0, 0.0, 0.0);
    }
    if (running) {
        z = vec_add(z, vec_scale(0.5 * tick_seconds(t.dt), vec_add(last, now)));
    }
    return u_I_max > 0.0 ? vec_clamp(z, u_I_max / K_I) : z;
}

/** [N m s] sum of h_i g_i with h_i = J_i (omega_BN . g_i + Omega_i), B components. */
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

/** [N m s] I_B omega_BN + sum of h_i g_i: the body's and, if their speeds are known, the wheels'; B components. */
static inline Vec3 total_momentum(Mat3 I_B, const WheelSet *wheels, const WheelSpeeds *speeds, Vec3 omega_BN_B)
{
    const Vec3 H = mat_vec(I_B, omega_BN_B);
    const int known = head_written(wheels->head) && head_written(speeds->head);
    return known ? vec_add(H, wheel_momentum(wheels, speeds, omega_BN_B)) : H;
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

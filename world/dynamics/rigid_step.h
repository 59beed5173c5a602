// SPDX-License-Identifier: Apache-2.0
// A step of Runge and Kutta for a rigid craft that nothing pushes, alone or with four balanced wheels, in registers
// from its begin to its end. It has the operations of the general way (SpacecraftModel::derive_simple,
// ReactionWheelsModel, sim::make_rk4), in their order, and so their bits.
#pragma once

#include "world/dynamics/lanes.h"

#include <type_traits>

namespace fledge::world {

/// The rate of the MRP sigma at the angular rate omega.
LANES_INLINE Quad mrp_rate(Quad sigma, Quad omega)
{
    const Quad bend = (1.0 - dot(sigma, sigma)) * omega + 2.0 * dot(sigma, omega) * sigma;
    return 0.25 * (bend + 2.0 * cross(sigma, omega));
}

/// The numbers of no wheels.
struct None {};
LANES_INLINE None operator+(None, None)
{
    return {};
}
LANES_INLINE None operator*(double, None)
{
    return {};
}

/// Wheels: what `h` is, a Quad, or None; of wheels that jitter, a Swing.
template <class Wheels> struct RigidState {
    Quad r, v, sigma, omega;
    Wheels h; ///< [N m s] momenta of the wheels
};
template <class Wheels>
LANES_INLINE RigidState<Wheels> operator+(const RigidState<Wheels> &a, const RigidState<Wheels> &b)
{
    return {a.r + b.r, a.v + b.v, a.sigma + b.sigma, a.omega + b.omega, a.h + b.h};
}
template <class Wheels> LANES_INLINE RigidState<Wheels> operator*(double s, const RigidState<Wheels> &a)
{
    return {s * a.r, s * a.v, s * a.sigma, s * a.omega, s * a.h};
}

/// What is constant in a step.
template <class Wheels> struct RigidCraft {
    using State = RigidState<Wheels>;
    static constexpr bool has_wheels = std::is_same_v<Wheels, Quad>;

    Quad inertia[3], inverse[3]; ///< columns
    Quad torque;                 ///< [N m] on the body
    Quad axis[4];                ///< of the wheels
    Wheels motor;                ///< [N m] on the wheels

    LANES_INLINE State rates(const State &x, Quad gravity) const
    {
        Quad momentum = combine(inertia[0], inertia[1], inertia[2], x.omega);
        if constexpr (has_wheels) {
            momentum += (axis[0] * x.h[0] + axis[1] * x.h[1]) + (axis[2] * x.h[2] + axis[3] * x.h[3]);
        }
        const Quad acting = torque - cross(x.omega, momentum);
        return {x.v, gravity, mrp_rate(x.sigma, x.omega), combine(inverse[0], inverse[1], inverse[2], acting), motor};
    }

    /// x after h [s], from its rates k1. gravity(tau, r): the acceleration at r after tau [s].
    template <class Gravity>
    LANES_INLINE State step(const State &x, const State &k1, double h, const Gravity &gravity) const
    {
        const auto after = [&](double tau, const State &k) __attribute__((always_inline))
        {
            const State probe = x + tau * k;
            return rates(probe, gravity(tau, probe.r));
        };
        const State k2 = after(0.5 * h, k1), k3 = after(0.5 * h, k2), k4 = after(h, k3);
        return x + h / 6.0 * ((k1 + k4) + 2.0 * (k2 + k3));
    }
};

} // namespace fledge::world

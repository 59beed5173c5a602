// SPDX-License-Identifier: Apache-2.0
// A step of Runge and Kutta for a rigid craft that something pushes, in registers from its begin to its end: inputs,
// thrusters without tanks, torque rods, and wheels, balanced ones or with simple jitter. It has the operations of the
// general way (SpacecraftModel::derive_pushed, the parts, sim::make_rk4), in their order, and so their bits.
#pragma once

#include "world/dynamics/coupled_step.h"
#include "world/dynamics/reaction_wheels_model.h"

namespace fledge::world {

/// What acts on the body.
struct Pushed {
    Quad force_B, torque, momentum;

    /// A force with its torque about B's origin; C is at c.
    LANES_INLINE void add(Quad force, Quad about_B, Quad c)
    {
        force_B = force_B + force;
        torque = torque + about_B - cross(c, force);
    }
};

// Wheels have turned(x), what their angles give; rates(x, turned, omega) of their states; momentum(x); and act(turned,
// rates, c, all), what they add to all that acts.

/// Balanced wheels.
struct PushedRotors : BalancedWheels {
    struct Turned {};

    LANES_INLINE Turned turned(Quad) const { return {}; }
    LANES_INLINE Quad rates(Quad, Turned, Quad) const { return quad_at(rotors.torque); }
    LANES_INLINE Quad momentum(Quad h) const { return world::momentum(rotors.axis, h); }
    LANES_INLINE void act(Turned, Quad, Quad, Pushed &all) const { all.torque += quad(*rotors.reaction); }
};

/// Wheels with simple jitter.
struct PushedJitter : ReactionWheelsModel::Four {
    LANES_INLINE Turned turned(const Swing &x) const { return Four::turned(x.at); }
    LANES_INLINE Swing rates(const Swing &x, const Turned &, Quad omega) const
    {
        return {Omega(x.rate, {quad(omega[0]), quad(omega[1]), quad(omega[2])}), quad_at(w.torque)};
    }
    LANES_INLINE Quad momentum(const Swing &x) const { return world::momentum(w.axis, x.rate); }
    LANES_INLINE void act(const Turned &now, const Swing &k, Quad c, Pushed &all) const
    {
        const Quad Omega = k.at;
        all.torque = all.torque + quad(w.reaction);
        all.add(sums(Quad3{} + Omega * Omega * now.u), sums(Quad3{} + Omega * Omega * now.d), c);
    }
};

/// No wheels.
struct PushedAlone : NoPart {
    struct Turned {};

    LANES_INLINE Turned turned(None) const { return {}; }
    LANES_INLINE None rates(None, Turned, Quad) const { return {}; }
    LANES_INLINE void act(Turned, None, Quad, Pushed &) const {}
};

/// What a part does in a step.
struct Pushing {
    enum Kind : std::uint32_t { as_wheels, as_rods, as_ramp } kind;
    Quad force, force_rate, torque, torque_rate; ///< of a ramp; the torques are about B's origin
    double since, since_end;                     ///< [s] from where it begins to the step's begin, to its end
};

template <class Wheels> struct PushedCraft {
    using State = RigidState<typename Wheels::State>;

    Wheels wheels;
    const Pushing *parts;
    std::size_t n;
    double per_mass;
    Quad force_N, force_B, torque; ///< of the inputs
    Quad center;                   ///< C in B
    Quad inertia[3], inverse[3];   ///< columns

    /// rods(tau, r, attitude): their torque. tau < 0: at the end of the step.
    template <class Rods>
    LANES_INLINE void rates(State &to, const State &x, double tau, Quad gravity, const Rods &rods) const
    {
        const auto turned = wheels.turned(x.h);
        const Attitude attitude(x.sigma);
        const Quad by_rods = rods(tau, x.r, attitude);
        to.h = wheels.rates(x.h, turned, x.omega);
        Pushed all;
        all.force_B = force_B;
        all.torque = torque;
        all.momentum = combine(inertia[0], inertia[1], inertia[2], x.omega);
        if constexpr (!std::is_same_v<typename Wheels::State, None>) {
            all.momentum += wheels.momentum(x.h);
        }
        for (std::size_t i = 0; i < n; i++) {
            const Pushing &part = parts[i];
            if (part.kind == Pushing::as_ramp) {
                const double t = tau < 0.0 ? part.since_end : part.since + tau;
                all.add(part.force + t * part.force_rate, part.torque + t * part.torque_rate, center);
            } else if (part.kind == Pushing::as_wheels) {
                wheels.act(turned, to.h, center, all);
            } else {
                all.torque += by_rods;
            }
        }
        to.r = x.v;
        to.v = gravity + per_mass * (force_N + attitude.to_N(all.force_B));
        to.sigma = mrp_rate(x.sigma, x.omega);
        to.omega = combine(inverse[0], inverse[1], inverse[2], all.torque - cross(x.omega, all.momentum));
    }

    /// From x and its rates k1 to those after h [s]. gravity(tau, r): the acceleration at r after tau [s], < 0: at the
    /// end.
    template <class Gravity, class Rods>
    LANES_INLINE void step(State &x, State &k1, double h, const Gravity &gravity, const Rods &rods) const
    {
        State k2, k3, k4;
        const auto after = [&](State &to, double tau, const State &k) LANES_LAMBDA {
            const State probe = x + tau * k;
            rates(to, probe, tau, gravity(tau, probe.r), rods);
        };
        after(k2, 0.5 * h, k1);
        after(k3, 0.5 * h, k2);
        after(k4, h, k3);
        x = x + h / 6.0 * ((k1 + k4) + 2.0 * (k2 + k3));
        if (dot(x.sigma, x.sigma) > 1.0) {
            x.sigma = quad(mrp_shadow(vec(x.sigma)));
        }
        rates(k1, x, -1.0, gravity(-1.0, x.r), rods);
    }
};

} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
// A step of Runge and Kutta for a craft that something pushes, in registers from its begin to its end: a rigid one with
// inputs, thrusters without tanks, torque rods, and wheels, balanced ones or with simple jitter; or one with tanks that
// feed its thrusters, and balanced wheels. It has the operations of the general way (SpacecraftModel::derive_pushed,
// the parts, sim::make_rk4), in their order, and so their bits.
#pragma once

#include "world/actuators/thrusters_model.h"
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
struct PushedJitter : ReactionWheelsModel::Lanes {
    LANES_INLINE Turned turned(const Swing &x) const { return Lanes::turned(x.at); }
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

template <class Wheels, bool has_rods> struct PushedCraft {
    using State = RigidState<typename Wheels::State>;

    Wheels wheels;
    const Pushing *parts;
    std::size_t n;
    double per_mass;
    Quad force_N, force_B, torque; ///< of the inputs
    Quad center;                   ///< C in B
    Quad dipole;                   ///< [A m^2] of the rods
    Quad inertia[3], inverse[3];   ///< columns

    /// tau < 0: at the end of the step. field: N components.
    LANES_INLINE void rates(State &to, const State &x, double tau, Quad gravity, Quad field) const
    {
        const auto turned = wheels.turned(x.h);
        const Attitude attitude(x.sigma);
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
            } else if constexpr (has_rods) {
                all.torque += turning(field, attitude);
            }
        }
        to.r = x.v;
        to.v = gravity + per_mass * (force_N + attitude.to_N(all.force_B));
        to.sigma = mrp_rate(x.sigma, x.omega);
        to.omega = combine(inverse[0], inverse[1], inverse[2], all.torque - cross(x.omega, all.momentum));
    }

    LANES_INLINE Quad turning(Quad field, const Attitude &attitude) const
    {
        return cross(dipole, attitude.to_B(field));
    }

    /// From x and its rates k1 to those after h [s]. gravity(tau, r): the acceleration at r after tau [s], < 0: at the
    /// end; field(tau, r, sigma): the field, which is called while the least is in registers.
    template <class Gravity, class Field>
    LANES_INLINE void step(State &x, State &k1, double h, const Gravity &gravity, const Field &field) const
    {
        State k2, k3, k4;
        const auto after = [&](State &to, double tau, const State &k) LANES_LAMBDA {
            const Quad B = field(tau, x.r + tau * k.r, x.sigma + tau * k.sigma);
            const State probe = x + tau * k;
            rates(to, probe, tau, gravity(tau, probe.r), B);
        };
        after(k2, 0.5 * h, k1);
        after(k3, 0.5 * h, k2);
        after(k4, h, k3);
        x = x + h / 6.0 * ((k1 + k4) + 2.0 * (k2 + k3));
        if (dot(x.sigma, x.sigma) > 1.0) {
            x.sigma = quad(mrp_shadow(vec(x.sigma)));
        }
        const Quad B = field(-1.0, x.r, x.sigma);
        rates(k1, x, -1.0, gravity(-1.0, x.r), B);
    }
};

/// A craft with tanks. What they hold depends on time alone, so that the second and the third stage share it.
template <class Wheels> struct TankedCraft {
    using State = RigidState<typename Wheels::State>;

    Wheels wheels;
    bool wheels_first; ///< they act before the thrusters
    const ThrustersModel &thrusters;
    const Whole &hub;
    double since, since_end;       ///< [s] from where the stretch begins to the step's begin, to its end
    Quad force_N, force_B, torque; ///< of the inputs

    struct Shape {
        double tau; ///< [s] in the stretch
        ThrustersModel::Content tanks;
        Quad mass; ///< and the moment
        SymmetricQuads inertia;
        RigidFactors factors;
    };
    LANES_INLINE void shape(double tau, Shape &to) const
    {
        to.tau = tau;
        thrusters.hold(tau, to.tanks);
        Placed all(hub);
        all.mass += to.tanks.mass;
        all.inertia = all.inertia + to.tanks.inertia;
        to.mass = all.mass;
        to.inertia = all.inertia;
        to.factors.take(all);
    }

    LANES_INLINE void rates(State &to, Quad &a, const State &x, Quad gravity, const Shape &now) const
    {
        const typename Wheels::Turned turned;
        const Attitude attitude(x.sigma);
        const Quad b = now.factors.b;
        const double per_mass = now.factors.per_mass;
        const Quad c = per_mass * b;
        to.h = wheels.rates(x.h, turned, x.omega);
        Pushed all;
        all.force_B = force_B;
        all.torque = torque;
        all.momentum = Quad{};
        if constexpr (!std::is_same_v<typename Wheels::State, None>) {
            all.momentum += wheels.momentum(x.h);
        }
        if (wheels_first) {
            wheels.act(turned, to.h, c, all);
        }
        double mass_rate = 0.0;
        Quad moment_rate{};
        if (thrusters.acts()) {
            ThrustersModel::Thrust thrust;
            thrusters.thrust<false>(now.tau, x.omega, now.tanks, thrust);
            mass_rate -= thrust.flow;
            moment_rate -= thrust.taken;
            all.add(thrust.force, thrust.torque, c);
        }
        if (!wheels_first) {
            wheels.act(turned, to.h, c, all);
        }
        const Quad force = all.force_B + attitude.to_B(force_N), drift{};
        const Quad momentum = now.inertia.times(x.omega) + all.momentum;
        now.factors.solve(Quad{} + force - cross(x.omega, cross(x.omega, b) + 2.0 * drift),
                          Quad{} + (all.torque + cross(c, force)) - cross(x.omega, momentum), a, to.omega);
        // As masses change, C moves in B without momentum.
        const Quad shift = per_mass * (moment_rate - mass_rate * c);
        const Quad gained = per_mass * (force - mass_rate * per_mass * drift) + cross(x.omega, shift);
        to.r = x.v + attitude.to_N(shift);
        to.v = gravity + attitude.to_N(gained);
        to.sigma = mrp_rate(x.sigma, x.omega);
    }

    /// From x and its rates k1 to those after h [s]; as PushedCraft::step(). `last`: at the end; a: of B's origin.
    template <class Gravity>
    LANES_INLINE void step(State &x, State &k1, Shape &last, Quad &a, double h, const Gravity &gravity) const
    {
        State k2, k3, k4;
        Shape middle, end;
        shape(since + 0.5 * h, middle);
        shape(since + h, end);
        shape(since_end, last);
        const auto after = [&](State &to, double tau, const State &k, const Shape &now) LANES_LAMBDA {
            const State probe = x + tau * k;
            rates(to, a, probe, gravity(tau, probe.r), now);
        };
        after(k2, 0.5 * h, k1, middle);
        after(k3, 0.5 * h, k2, middle);
        after(k4, h, k3, end);
        x = x + h / 6.0 * ((k1 + k4) + 2.0 * (k2 + k3));
        if (dot(x.sigma, x.sigma) > 1.0) {
            x.sigma = quad(mrp_shadow(vec(x.sigma)));
        }
        rates(k1, a, x, gravity(-1.0, x.r), last);
    }
};

} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
// The equations of a Whole in registers, and a step of Runge and Kutta for a craft with coupled parts that nothing
// pushes. The step has the operations of the general way (SpacecraftModel::solve, the parts, sim::make_rk4), in their
// order for each result, and so their bits.
//
// The matrix of the whole depends on places alone, and the places of the next stage on rates that this stage begins
// with. So the step computes the next matrix and its factors while the accelerations of this stage are on their way:
// the chain from one stage to the next is that of the rates alone.
#pragma once

#include "flight/math/attitude.h"
#include "world/dynamics/rigid_step.h"

namespace fledge::world {

/// The second to the fourth number, and a 0.
LANES_INLINE Quad after_first(Quad a)
{
    return __builtin_shufflevector(a, Quad{}, 1, 2, 3, 4);
}

/// What the places of all masses add to a Whole.
struct Placed {
    Quad mass; ///< and the moment
    SymmetricQuads inertia, linear, angular;
    Quad cross[3];

    LANES_INLINE explicit Placed(const Whole &w)
        : mass(quad_at(&w.mass)), inertia(symmetric(w.inertia)), linear(symmetric(w.linear)),
          angular(symmetric(w.angular)), cross{quad_at(w.cross.m[0]), quad_at(w.cross.m[1]), quad_at(w.cross.m[2])}
    {
    }
    LANES_INLINE void put(Whole &w) const
    {
        put_quad(&w.mass, mass);
        inertia.put(w.inertia);
        linear.put(w.linear);
        angular.put(w.angular);
        for (int i = 0; i < 3; i++) {
            put_quad(w.cross.m[i], cross[i]);
        }
    }
    LANES_INLINE Quad moment() const { return after_first(mass); }
};

/// What the rates of moving masses add to a Whole; `acting` and `momentum` of the Loads.
struct Moved {
    Quad drift{}, force{}, torque{}, momentum{}, acting{};

    LANES_INLINE explicit Moved(Quad on_body) : acting(on_body) {}
    LANES_INLINE Moved(const Whole &w, const Loads &loads)
        : drift(quad(w.drift)), force(quad(w.force)), torque(quad(w.torque)), momentum(quad(loads.momentum)),
          acting(quad(loads.torque))
    {
    }
    LANES_INLINE void put(Whole &w, Loads &loads) const
    {
        world::put(w.drift, drift);
        world::put(w.force, force);
        world::put(w.torque, torque);
        world::put(loads.momentum, momentum);
        world::put(loads.torque, acting);
    }
};

/// What inverts a symmetric matrix.
struct Adjugate {
    SymmetricQuads adjugate;
    double determinant;

    LANES_INLINE explicit Adjugate(const SymmetricQuads &a)
        : adjugate{yzx(a.along) * zxy(a.along) - a.across * a.across,
                   yzx(a.across) * zxy(a.across) - a.along * a.across}
    {
        const Quad along = a.along * adjugate.along, across = a.across * adjugate.across;
        determinant = along[0] + (across[1] + across[2]);
    }
};

/// What solves the equations of a Whole, from places alone.
struct Factors {
    SymmetricQuads linear, angular; ///< what is left of mass and of inertia, the latter times `determinant`
    SymmetricQuads by_force, by_torque;
    Quad r[3];
    double determinant, per_force, per_torque;

    LANES_INLINE void take(const Placed &w)
    {
        const Quad b = w.moment(), mass = quad(w.mass[0]);
        const Quad c[3] = {Quad{0.0, 1.0, -1.0, 0.0} * __builtin_shufflevector(b, b, 3, 2, 1, 3) - w.cross[0],
                           Quad{-1.0, 0.0, 1.0, 0.0} * __builtin_shufflevector(b, b, 2, 3, 0, 3) - w.cross[1],
                           Quad{1.0, -1.0, 0.0, 0.0} * __builtin_shufflevector(b, b, 1, 0, 3, 3) - w.cross[2]};
        linear = {__builtin_shufflevector(mass, Quad{}, 0, 1, 2, 4) - w.linear.along, -w.linear.across};
        const Adjugate p(linear);
        // with the determinant as a factor, so that the second matrix need not wait for its inverse
        const Quad along = p.adjugate.along, across = p.adjugate.across;
        r[0] = c[0] * along[0] + c[1] * across[2] + c[2] * across[1];
        r[1] = c[0] * across[2] + c[1] * along[1] + c[2] * across[0];
        r[2] = c[0] * across[1] + c[1] * across[0] + c[2] * along[2];
        const SymmetricQuads taken = product(r[0], c[0]) + product(r[1], c[1]) + product(r[2], c[2]);
        angular = p.determinant * (w.inertia - w.angular) - taken;
        const Adjugate q(angular);
        by_force = p.adjugate;
        by_torque = q.adjugate;
        determinant = p.determinant;
        per_force = 1.0 / p.determinant;
        per_torque = 1.0 / q.determinant;
    }

    /// Accelerations: a of B's origin less gravity, and domega.
    LANES_INLINE void solve(Quad force, Quad torque, Quad &a, Quad &domega) const
    {
        const Quad met = determinant * torque - combine(r[0], r[1], r[2], force);
        domega = per_torque * by_torque.times(met);
        a = per_force * (by_force.times(force) - sums(r[0] * domega, r[1] * domega, r[2] * domega, Quad{}));
    }
};

/// The same where no part has a degree of freedom. With the moment b of the mass M, the inertia about the centre of
/// mass is what the angular acceleration meets: I - (b.b - b b) / M.
struct RigidFactors {
    SymmetricQuads by_torque;
    Quad b;
    double mass, per_mass, per_torque;

    LANES_INLINE void take(const Placed &w)
    {
        b = w.moment();
        mass = w.mass[0];
        const double b2 = dot(b, b);
        const SymmetricQuads spread = SymmetricQuads{{b2, b2, b2, 0.0}, {}} - product(b, b);
        const Adjugate q(mass * w.inertia - spread); // with the mass as a factor, so that no division waits
        by_torque = q.adjugate;
        per_mass = 1.0 / mass;
        per_torque = 1.0 / q.determinant;
    }

    LANES_INLINE void solve(Quad force, Quad torque, Quad &a, Quad &domega) const
    {
        domega = per_torque * by_torque.times(mass * torque - cross(b, force));
        a = per_mass * (force + cross(b, domega));
    }
};

// The states of a part are a Swing, four numbers without a coordinate (a Quad), or None.

/// Four coordinates, and their rates or momenta.
struct Swing {
    Quad at, rate;
};
LANES_INLINE Swing operator+(const Swing &a, const Swing &b)
{
    return {a.at + b.at, a.rate + b.rate};
}
LANES_INLINE Swing operator*(double s, const Swing &a)
{
    return {s * a.at, s * a.rate};
}
LANES_INLINE Quad coordinate(const Swing &x)
{
    return x.at;
}
LANES_INLINE None coordinate(Quad)
{
    return {};
}
LANES_INLINE None coordinate(None)
{
    return {};
}
LANES_INLINE void set_coordinate(Swing &x, Quad at)
{
    x.at = at;
}
LANES_INLINE void set_coordinate(auto &, None) {}

/// Within its usual range at the end of a step.
template <class Part, class Coordinate> LANES_INLINE Coordinate normalized(Coordinate at)
{
    if constexpr (requires { Part::normalized(at); }) {
        return Part::normalized(at);
    } else {
        return at;
    }
}

/// A craft with coupled parts of one or two kinds. A part of it has
///
///   State, load(from), store(to, State)      its states, and where they stand; sum(State): a sum of them all
///   place(coordinate, Placed &, Place &)     what it adds where it is, and what it keeps of that
///   act(Place, State, omega, Moved &)        what its rates add -> Acting, whose `rate` is that of its coordinate
///   accelerate(Place, Acting, a, domega)     -> the rates of its states
///   normalized(coordinate)                   if a step changes its range
///   show(Acting)                             if it shows something of the last stage
///   is_free                                  false if it has no degree of freedom
template <class First, class Second> struct CoupledCraft {
    First first;
    Second second;
    const Whole &hub;
    Quad torque; ///< [N m] on the body
    double h;    ///< [s] of a step

    static constexpr bool is_rigid = requires { requires !First::is_free; };

    struct State {
        Quad r, v, sigma, omega;
        typename First::State first;
        typename Second::State second;

        LANES_INLINE State operator+(const State &b) const
        {
            return {r + b.r, v + b.v, sigma + b.sigma, omega + b.omega, first + b.first, second + b.second};
        }
        LANES_INLINE friend State operator*(double s, const State &a)
        {
            return {s * a.r, s * a.v, s * a.sigma, s * a.omega, s * a.first, s * a.second};
        }
    };
    /// What a stage has of its places.
    struct Shape {
        Quad mass;
        SymmetricQuads inertia;
        typename First::Place first;
        typename Second::Place second;
        std::conditional_t<is_rigid, RigidFactors, Factors> factors;
    };
    /// Besides the rates, what the craft shows.
    struct Rates {
        State k;
        Quad drift, a;
    };

    template <class AtFirst, class AtSecond>
    LANES_INLINE void place(Shape &to, const AtFirst &at_first, const AtSecond &at_second) const
    {
        Placed all(hub);
        first.place(at_first, all, to.first);
        second.place(at_second, all, to.second);
        to.mass = all.mass;
        to.inertia.along = all.inertia.along;
        to.inertia.across = all.inertia.across;
        to.factors.take(all);
    }

    /// The rates of the state x. next(first, second) gets what the parts do, as soon as that is known, to place the
    /// next stage by their rates.
    template <class Next>
    LANES_INLINE void rates(Rates &to, const State &x, Quad gravity, const Shape &now, const Next &next) const
    {
        Moved moved(torque);
        const auto on_first = first.act(now.first, x.first, x.omega, moved);
        const auto on_second = second.act(now.second, x.second, x.omega, moved);
        next(on_first, on_second);
        const Quad momentum = now.inertia.times(x.omega) + moved.momentum;
        const Quad force =
            moved.force + Quad{} - cross(x.omega, cross(x.omega, after_first(now.mass)) + 2.0 * moved.drift);
        now.factors.solve(force, moved.torque + moved.acting - cross(x.omega, momentum), to.a, to.k.omega);
        to.k.r = x.v;
        to.k.v = gravity;
        to.k.sigma = mrp_rate(x.sigma, x.omega);
        to.k.first = first.accelerate(now.first, on_first, to.a, to.k.omega);
        to.k.second = second.accelerate(now.second, on_second, to.a, to.k.omega);
        to.drift = moved.drift;
    }

    /// One step from x with the rates k1. gravity(tau, r): the acceleration at r after tau [s], < 0: at the end.
    /// end(x, rates, mass) gets the result.
    template <class Gravity, class End>
    LANES_INLINE void step(const State &x, const State &k1, const Gravity &gravity, const End &end) const
    {
        const auto at_first = coordinate(x.first);
        const auto at_second = coordinate(x.second);
        auto f1 = coordinate(k1.first), f2 = f1, f3 = f1, first_end = f1;
        auto g1 = coordinate(k1.second), g2 = g1, g3 = g1, second_end = g1;
        Shape s2, s3, s4, s5;
        Rates k2, k3, k4, k5;
        place(s2, at_first + 0.5 * h * f1, at_second + 0.5 * h * g1);
        const State x2 = x + 0.5 * h * k1;
        rates(k2, x2, gravity(0.5 * h, x2.r), s2, [&](const auto &f, const auto &g) LANES_LAMBDA {
            f2 = f.rate, g2 = g.rate;
            place(s3, at_first + 0.5 * h * f.rate, at_second + 0.5 * h * g.rate);
        });
        const State x3 = x + 0.5 * h * k2.k;
        rates(k3, x3, gravity(0.5 * h, x3.r), s3, [&](const auto &f, const auto &g) LANES_LAMBDA {
            f3 = f.rate, g3 = g.rate;
            place(s4, at_first + h * f.rate, at_second + h * g.rate);
        });
        const State x4 = x + h * k3.k;
        rates(k4, x4, gravity(h, x4.r), s4, [&](const auto &f, const auto &g) LANES_LAMBDA {
            first_end = normalized<First>(at_first + h / 6.0 * ((f1 + f.rate) + 2.0 * (f2 + f3)));
            second_end = normalized<Second>(at_second + h / 6.0 * ((g1 + g.rate) + 2.0 * (g2 + g3)));
            place(s5, first_end, second_end);
        });
        State x5 = x + h / 6.0 * ((k1 + k4.k) + 2.0 * (k2.k + k3.k));
        set_coordinate(x5.first, first_end);
        set_coordinate(x5.second, second_end);
        if (dot(x5.sigma, x5.sigma) > 1.0) {
            x5.sigma = quad(mrp_shadow(vec(x5.sigma)));
        }
        rates(k5, x5, gravity(-1.0, x5.r), s5, [&](const auto &f, const auto &g) LANES_LAMBDA {
            if constexpr (requires { first.show(f); }) {
                first.show(f);
            }
            if constexpr (requires { second.show(g); }) {
                second.show(g);
            }
        });
        end(x5, k5, s5.mass);
    }
};

/// Without a coordinate.
struct Still {
    None rate;
};

/// Of four wheels with the momenta h.
LANES_INLINE Quad momentum(const double (*axis)[4], Quad h)
{
    const auto of = [&](std::size_t i) LANES_LAMBDA { return quad_at(axis[i]) * h[i]; };
    return (of(0) + of(1)) + (of(2) + of(3));
}

/// Balanced wheels on a craft that another part makes a coupled one.
struct BalancedWheels {
    using State = Quad;
    using Place = None;
    const Rotors &rotors;

    LANES_INLINE static Quad load(const double *x) { return quad_at(x); }
    LANES_INLINE static void store(double *x, Quad h) { put_quad(x, h); }
    LANES_INLINE static Quad sum(Quad h) { return h; }
    LANES_INLINE void place(None, Placed &, Place &) const {}
    LANES_INLINE Still act(None, Quad h, Quad, Moved &all) const
    {
        all.momentum += momentum(rotors.axis, h);
        return {};
    }
    LANES_INLINE Quad accelerate(None, Still, Quad, Quad) const { return quad_at(rotors.torque); }
};

/// No second part.
struct NoPart {
    using State = None;
    using Place = None;

    LANES_INLINE static None load(const double *) { return {}; }
    LANES_INLINE static void store(double *, None) {}
    LANES_INLINE static Quad sum(None) { return Quad{}; }
    LANES_INLINE void place(None, Placed &, Place &) const {}
    LANES_INLINE Still act(None, None, Quad, Moved &) const { return {}; }
    LANES_INLINE None accelerate(None, Still, Quad, Quad) const { return {}; }
};

} // namespace fledge::world

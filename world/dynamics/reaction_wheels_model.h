// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/reaction_wheels.h.
//
// The state of a wheel is its inertial angular momentum about its axis, h = J (g . omega + Omega):
//
//   dh = u + friction - c Omega,   Omega = h / J - g . omega,
//
// and the body feels the opposite torque about g. The motor's torque u and the Coulomb friction are
// chosen at the start of each update and hold through it:
//
// - friction is the torque that brings the wheel to rest at the update's end, but at most F. So a fast
//   wheel feels F against its motion, a slow one stops instead of turning round, and one at rest stays
//   at rest until the motor overcomes F;
// - near the speed limit the motor gives the torque that reaches the limit at the update's end, so it
//   does not chatter between full torque and none. It never brakes by itself. The spacecraft finds this
//   torque, for it turns the body and so the other wheels (SpacecraftModel::govern).
//
// For the friction, the body keeps its last angular acceleration during the update. So the equations are
// smooth within an update, as integrators of high order need, and the choice converges as updates become
// shorter: choose the period so that a wheel's speed changes little in one update.
//
// An imbalanced wheel has its angle as a second state. Its centre of mass is off the axis in the direction u(theta);
// w = g x u. With sigma = unbalance w and delta = couple w + r x sigma,
//
//   dh = u + friction - c Omega + 1/2 omega . (dI/dtheta omega) - sigma . a - delta . domega
//
// (docs/dynamics.md). With `jitter`, only Omega^2 (unbalance u) at r, and Omega^2 couple u, act on the body.
#pragma once

#include "world/dynamics/coupled_step.h"
#include "world/dynamics/reaction_wheels.h"
#include "world/faults.h"

#include <numbers>

namespace fledge::world {

using sim::state_block;

class ReactionWheelsModel final : public Effector {
public:
    explicit ReactionWheelsModel(ReactionWheels &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;

    /// Limits and friction take effect at the next update; axes, inertias and speeds at a reset.
    void refresh() override;

    void reseed() override { wheels_.faults.reseed(seeded_); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&wheels_, 1)); }

    std::size_t states() const override;
    std::vector<StateName> names() const override;
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    const Rotors *rotors() const override { return imbalanced_ || viscous() ? nullptr : &rotors_; }
    bool pushes() const override { return imbalanced() && interface_.par.jitter; }
    void add_hidden_inertia(Mat3 &inertia) const override;
    bool couples() const override { return imbalanced() && !interface_.par.jitter; }
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void normalize(double *x) const override;
    Drive drive_at(std::size_t i, const double *x, const Vec3 &omega) const override
    {
        return {wheels_.motor[i], wheels_.share[i], speed(i, x, omega), interface_.par.Omega_max[i]};
    }
    double drive_rate(std::size_t i, const double *, const double *dx, const BodyRate &rate) const override
    {
        return speed(i, dx, rate.domega);
    }
    void give(std::size_t i, double share) override;
    std::size_t most_drives() const override { return n_; }
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

    /// The wheels in blocks of state_block; entries that fill a block up have no axis and no torque.
    struct Wheels {
        double g[3][WHEELS_MAX];    ///< unit spin axes, in B
        double axis[WHEELS_MAX][4]; ///< the same
        double J[WHEELS_MAX], J_inverse[WHEELS_MAX];
        double requested[WHEELS_MAX]; ///< [N m] commanded to the motor in the last update
        double motor[WHEELS_MAX];     ///< [N m] the same within u_max
        double share[WHEELS_MAX];     ///< of that, as the limit of speed leaves it
        double friction[WHEELS_MAX];  ///< [N m] of Coulomb
        double torque[WHEELS_MAX];    ///< [N m] on the wheel, without viscous friction
        double viscosity[WHEELS_MAX]; ///< [N m s]
        Vec3 reaction;                ///< [N m] of `torque` on the body
        // Of imbalanced ones, by components: unbalance u and couple u + r x (unbalance u), each at theta = 0 and 90 deg
        // further; and what they add to the inertia about B's origin.
        double u[2][3][WHEELS_MAX], d[2][3][WHEELS_MAX], inertia[2][6][WHEELS_MAX];
        double viscous; ///< the largest viscosity
        Faults<2 * WHEELS_MAX> faults;
        double rubs;    ///< whether there is friction or a limit of speed: torques depend on the speeds
        double limits;  ///< whether there is such a limit
        double again;   ///< whether the torques may change although the commands do not
        double limited; ///< whether u_max reduces a torque
    };

    /// Imbalanced wheels in four lanes, `i` and the next three, as a part of a CoupledCraft.
    struct Lanes {
        using State = Swing;
        struct Turned {
            Quad sine, cosine;
            Quad3 u, sigma; ///< [kg m]   unbalance times u and w
            Quad3 d, delta; ///< [kg m^2] couple u + r x (unbalance u), and delta
        };
        struct Place {
            Quad3 u, d, sigma, delta, push, turn;
            QuadSymmetric bends; ///< the derivative of what they add to the inertia
        };
        struct Acting {
            Quad force, rate;
        };
        const Wheels &w;
        std::size_t i;

        LANES_INLINE Turned turned(Quad theta) const
        {
            Quad s, c;
            sincos(theta, s, c);
            const Quad3 u[2] = {quads(w.u[0], i), quads(w.u[1], i)};
            const Quad3 d[2] = {quads(w.d[0], i), quads(w.d[1], i)};
            return {s, c, c * u[0] + s * u[1], c * u[1] - s * u[0], c * d[0] + s * d[1], c * d[1] - s * d[0]};
        }
        LANES_INLINE Quad Omega(Quad h, const Quad3 &omega) const
        {
            return h * quad_at(w.J_inverse + i) - dot(quads(w.g, i), omega);
        }
        LANES_INLINE void place(Quad theta, Placed &all, Place &to) const;
        LANES_INLINE Acting act(const Place &at, const Swing &x, Quad omega, Moved &all) const;
        LANES_INLINE Swing accelerate(const Place &at, const Acting &now, Quad a, Quad domega) const;
        static Quad normalized(Quad theta);
        LANES_INLINE static Swing load(const double *x) { return {quad_at(x + 4), quad_at(x)}; }
        LANES_INLINE static void store(double *x, const Swing &k)
        {
            put_quad(x, k.rate);
            put_quad(x + 4, k.at);
        }
        LANES_INLINE static Quad sum(const Swing &x) { return x.at + x.rate; }
    };
    std::size_t size() const { return interface_.par.n; }
    Lanes lanes() const { return {wheels_, 0}; } ///< the first ones
    bool viscous() const { return wheels_.viscous > 0.0; }

private:
    bool imbalanced() const;
    void shake(const double *x, const Motion &motion, double *dx, Loads &loads) const;
    void check() const;
    void show(const double *x, const Vec3 &omega);
    bool begin_faults(sim::Ns t)
    {
        const auto &par = interface_.par;
        return wheels_.faults.begin(t, par.n_faults, par.faults, interface_.in.injected);
    }
    bool measure_faultily(WheelSpeeds &speeds);
    bool as_before(bool commanded) const;
    double rub(std::size_t i, const double *x, const BodyRate &rate, double dt, double u) const;
    void react();

    void derive_in_lanes(const double *x, const Motion &motion, double *dx, Loads &loads) const;
    void couple_in_lanes(const double *x, const Motion &motion, Loads &loads, Whole &whole);
    void accelerate_in_lanes(const Vec3 &a, const Vec3 &domega, double *dx) const;
    void drag(const double *x, const Motion &motion, double *dx, Loads &loads) const;

    double along(std::size_t i, const Vec3 &a) const
    {
        return wheels_.g[0][i] * a.v[0] + wheels_.g[1][i] * a.v[1] + wheels_.g[2][i] * a.v[2];
    }
    double speed(std::size_t i, const double *x, const Vec3 &omega) const
    {
        return x[i] * wheels_.J_inverse[i] - along(i, omega);
    }

    ReactionWheels &interface_;
    std::string name_;
    sim::Random seeded_;
    std::size_t n_ = 0, padded_ = 0;
    bool imbalanced_ = false, coupled_ = false;
    Wheels wheels_{};
    Rotors rotors_{0, wheels_.axis, wheels_.torque, &wheels_.reaction};
    // From couple() to accelerate().
    Lanes::Place places_[WHEELS_MAX / state_block]{};
    Lanes::Acting acting_[WHEELS_MAX / state_block]{};
};

LANES_INLINE void ReactionWheelsModel::Lanes::place(Quad theta, Placed &all, Place &to) const
{
    const Turned now = turned(theta);
    const Quad3 &u = now.u, &sigma = now.sigma, &delta = now.delta, g = quads(w.g, i);
    const Quad by_J = quad_at(w.J_inverse + i);
    const QuadSymmetric in[2] = {symmetric(w.inertia[0], i), symmetric(w.inertia[1], i)};
    const Quad3 turn = g + by_J * delta, push = by_J * sigma;
    all.inertia = all.inertia + (now.cosine * in[0] + now.sine * in[1]).sum();
    all.mass += sums(Quad{}, u.x, u.y, u.z);
    all.linear = all.linear + product(push, sigma).sum();
    all.cross[0] += sums(sigma.x * turn);
    all.cross[1] += sums(sigma.y * turn);
    all.cross[2] += sums(sigma.z * turn);
    all.angular = all.angular + (product(delta, turn) + product(g, delta)).sum();
    to.u = u;
    to.d = now.d;
    to.sigma = sigma;
    to.delta = delta;
    to.push = push;
    to.turn = turn;
    to.bends = now.cosine * in[1] - now.sine * in[0];
}

// The coordinate is the wheel's angle in inertial space: its rate is h / J. So the inertia about the axis, which
// I_B leaves out, is in no difference of large numbers.
LANES_INLINE ReactionWheelsModel::Lanes::Acting ReactionWheelsModel::Lanes::act(const Place &at, const Swing &x,
                                                                                Quad rate, Moved &all) const
{
    const Quad3 omega{quad(rate[0]), quad(rate[1]), quad(rate[2])}, bends = at.bends.times(omega);
    const Quad h = x.rate, Omega = this->Omega(h, omega);
    const Quad force = quad_at(w.torque + i) - quad_at(w.viscosity + i) * Omega + 0.5 * dot(omega, bends);
    all.drift += sums(Omega * at.sigma);
    all.force += sums(Omega * Omega * at.u - force * at.push);
    all.torque += sums(Omega * (Omega * at.d - bends) - force * at.turn);
    all.momentum += sums(h * quads(w.g, i) + Omega * at.delta);
    return {force, Omega};
}

LANES_INLINE Swing ReactionWheelsModel::Lanes::accelerate(const Place &at, const Acting &now, Quad a, Quad domega) const
{
    const Quad3 linear{quad(a[0]), quad(a[1]), quad(a[2])}, angular{quad(domega[0]), quad(domega[1]), quad(domega[2])};
    return {now.rate, now.force - dot(at.sigma, linear) - dot(at.delta, angular)};
}

/// Angles within a turn keep their digits.
LANES_INLINE Quad ReactionWheelsModel::Lanes::normalized(Quad theta)
{
    const double pi = std::numbers::pi;
    const auto beyond = (theta > pi) | (theta < -pi);
    return beyond ? theta - 2.0 * pi * nearest(theta / quad(2.0 * pi)) : theta;
}

} // namespace fledge::world

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
//   does not chatter between full torque and none. It never brakes by itself.
//
// For both, the body keeps its last angular acceleration during the update. So the equations are smooth
// within an update, as integrators of high order need, and the choice converges as updates become
// shorter: choose the period so that a wheel's speed changes little in one update.
//
// An imbalanced wheel has its angle as a second state. Its centre of mass is off the axis in the direction u(theta);
// w = g x u. With sigma = unbalance w and delta = couple w + r x sigma,
//
//   dh = u + friction - c Omega + 1/2 omega . (dI/dtheta omega) - sigma . a - delta . domega
//
// (docs/dynamics.md). With `jitter`, only Omega^2 (unbalance u) at r, and Omega^2 couple u, act on the body.
#pragma once

#include "world/dynamics/lanes.h"
#include "world/dynamics/reaction_wheels.h"
#include "world/faults.h"

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
    const Rotors *rotors() const override { return imbalanced_ || wheels_.viscous > 0.0 ? nullptr : &rotors_; }
    bool pushes() const override { return imbalanced() && interface_.par.jitter; }
    void add_hidden_inertia(Mat3 &inertia) const override;
    bool couples() const override { return imbalanced() && !interface_.par.jitter; }
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void normalize(double *x) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    /// The wheels in blocks of state_block; entries that fill a block up have no axis and no torque.
    struct Wheels {
        double g[3][WHEELS_MAX];    ///< unit spin axes, in B
        double axis[WHEELS_MAX][4]; ///< the same
        double J[WHEELS_MAX], J_inverse[WHEELS_MAX];
        double requested[WHEELS_MAX]; ///< [N m] commanded to the motor in the last update
        double torque[WHEELS_MAX];    ///< [N m] on the wheel, without viscous friction
        double viscosity[WHEELS_MAX]; ///< [N m s]
        Vec3 reaction;                ///< [N m] of `torque` on the body
        // Of imbalanced ones, by components: unbalance u and couple u + r x (unbalance u), each at theta = 0 and 90 deg
        // further; and what they add to the inertia about B's origin.
        double u[2][3][WHEELS_MAX], d[2][3][WHEELS_MAX], inertia[2][6][WHEELS_MAX];
        double viscous; ///< the largest viscosity
        Faults<2 * WHEELS_MAX> faults;
        double rubs;    ///< whether there is friction or a limit of speed: torques depend on the speeds
        double again;   ///< whether the torques may change although the commands do not
        double limited; ///< whether a limit reduces a torque
    };

    /// What an imbalanced wheel has at its angle.
    struct Turned {
        Quad sine, cosine;
        Quad3 u, sigma; ///< [kg m]   unbalance times u and w
        Quad3 d, delta; ///< [kg m^2] couple u + r x (unbalance u), and delta
    };
    Turned turned(std::size_t i, const double *x) const; ///< of the wheels i to i + 3

    bool imbalanced() const;
    void shake(const double *x, const Motion &motion, double *dx, Loads &loads) const;
    void check() const;
    bool begin_faults(sim::Ns t)
    {
        const auto &par = interface_.par;
        return wheels_.faults.begin(t, par.n_faults, par.faults, interface_.in.injected);
    }
    bool measure_faultily(WheelSpeeds &speeds);
    bool as_before(bool commanded) const;
    double rub(std::size_t i, const double *x, const BodyRate &rate, double dt, double &u) const;

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
    struct Acting {
        Quad force, rate;
        Quad3 sigma, delta;
    };
    Acting acting_[WHEELS_MAX / state_block]{};
};

} // namespace fledge::world

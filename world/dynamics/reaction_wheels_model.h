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
#pragma once

#include "world/dynamics/effector.h"
#include "world/dynamics/reaction_wheels.h"

namespace fledge::world {

class ReactionWheelsModel final : public Effector {
public:
    explicit ReactionWheelsModel(ReactionWheels &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;

    /// Limits and friction take effect at the next update; axes, inertias and speeds at a reset.
    void refresh() override;

    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&wheels_, 1)); }

    std::size_t states() const override;
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void derive(const double *x, const Vec3 &omega, double *dx, Loads &loads) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    /// The wheels in blocks of state_block; entries that fill a block up have no axis and no torque.
    struct Wheels {
        double gx[WHEELS_MAX], gy[WHEELS_MAX], gz[WHEELS_MAX]; ///< unit spin axes, in B
        double J[WHEELS_MAX], J_inverse[WHEELS_MAX];
        double asked[WHEELS_MAX];     ///< [N m] commanded to the motor in the last update
        double torque[WHEELS_MAX];    ///< [N m] on the wheel, without viscous friction
        double viscosity[WHEELS_MAX]; ///< [N m s]
        Vec3 reaction;                ///< [N m] of `torque` on the body
        double viscous;               ///< the largest viscosity
        double by_speed;              ///< 0: the torques depend on the commands alone, not on the speeds
    };

    bool as_before(bool commanded) const;

    double along(std::size_t i, const Vec3 &a) const
    {
        return wheels_.gx[i] * a.v[0] + wheels_.gy[i] * a.v[1] + wheels_.gz[i] * a.v[2];
    }
    double speed(std::size_t i, const double *x, const Vec3 &omega) const
    {
        return x[i] * wheels_.J_inverse[i] - along(i, omega);
    }

    ReactionWheels &interface_;
    std::size_t n_ = 0, padded_ = 0;
    Wheels wheels_{};
};

} // namespace fledge::world

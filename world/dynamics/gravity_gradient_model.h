// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/gravity_gradient.h: the sum of 3 mu / r^5 r x (I r) over the bodies, with the
// inertia of all about the centre of mass.
#pragma once

#include "world/dynamics/effector.h"
#include "world/dynamics/gravity_gradient.h"

namespace fledge::world {

class SpacecraftModel;

class GravityGradientModel final : public Effector {
public:
    explicit GravityGradientModel(GravityGradient &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override { name_ = setup.name; }
    void join(const sim::Model &spacecraft) override;
    std::size_t states() const override { return 0; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *, const BodyRate &, double) override { return false; }
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    bool pushes() const override { return true; }
    unsigned needs() const override { return needs_inertia | needs_place | needs_attitude; }
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    GravityGradient &interface_;
    std::string name_;
    const SpacecraftModel *craft_ = nullptr;
    mutable Vec3 torque_B_{}; ///< of the last derive(), for the output
};

} // namespace fledge::world

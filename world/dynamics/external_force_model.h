// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/external_force.h.
#pragma once

#include "world/dynamics/effector.h"
#include "world/dynamics/external_force.h"

namespace fledge::world {

class ExternalForceModel final : public Effector {
public:
    explicit ExternalForceModel(ExternalForce &interface) : interface_(interface) {}

    void prepare(const sim::Setup &) override {}
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&held_, 1)); }

    std::size_t states() const override { return 0; }
    bool pushes() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    void publish(sim::Ns, const double *, const Vec3 &) override {}

private:
    struct Held {
        Vec3 force_N, force_B, torque_B;
    };
    ExternalForce &interface_;
    Held held_{};
};

} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/fuel_slosh.h. The states are the displacements, then their rates:
//
//   m (ddrho + p . (a + domega x r)) = -k rho - c drho - m p . (omega x (omega x r)),   r = r_0 + rho p
#pragma once

#include "world/dynamics/fuel_slosh.h"
#include "world/dynamics/lanes.h"

#include <span>
#include <utility>

namespace fledge::world {

class FuelSloshModel final : public Effector {
public:
    explicit FuelSloshModel(FuelSlosh &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&lines_, 1)); }

    std::size_t states() const override { return 2 * sim::padded(interface_.par.n); }
    std::vector<StateName> names() const override;
    bool couples() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *, const BodyRate &, double) override { return std::exchange(changed_, false); }
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void tide(const Mat3 &gradient, const Vec3 &c, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    FuelSlosh &interface_;
    bool changed_ = true;           ///< parameters, since the last latch()
    std::size_t n_ = 0, rates_ = 0; ///< where the rates begin

    /// The particles by fours; one that fills a four up has no mass.
    struct Lines {
        double axis[3][SLOSH_MAX], place[3][SLOSH_MAX]; ///< unit vectors; where the springs are at rest
        double turn[3][SLOSH_MAX];                      ///< per mass
        double mass[SLOSH_MAX], stiffness[SLOSH_MAX], damping[SLOSH_MAX]; ///< the last two per mass
        Whole all; ///< mass and what the degrees of freedom take, both of which are constant
    };
    Lines lines_{};
    const double *x_ = nullptr;                  ///< of the last couple()
    Quad force_[SLOSH_MAX / sim::state_block]{}; ///< from couple() to accelerate(): per mass

    void couple_in_lanes(const double *x, const Vec3 &rate, Loads &loads, Whole &whole);
    void accelerate_in_lanes(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const;
};

} // namespace fledge::world

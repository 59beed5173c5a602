// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/slosh_pendulum.h. The states of a pendulum are the unit vector n along its rod
// and the rate of n as the body sees it, so that no direction is singular. Perpendicular to n:
//
//   m l ddn = -c l dn - m (a + domega x r + omega x (omega x r) + 2 omega x (l dn)),   r = r_0 + l n
#pragma once

#include "world/dynamics/effector.h"
#include "world/dynamics/slosh_pendulum.h"

#include <utility>

namespace fledge::world {

class SloshPendulumModel final : public Effector {
public:
    explicit SloshPendulumModel(SloshPendulum &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void refresh() override { changed_ = true; }

    std::size_t states() const override { return 2 * sim::state_block * interface_.par.n; }
    std::vector<StateName> names() const override;
    bool couples() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *, const BodyRate &, double) override { return std::exchange(changed_, false); }
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void tide(const Mat3 &gradient, const Vec3 &c, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void normalize(double *x) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    SloshPendulum &interface_;
    bool changed_ = true; ///< parameters, since the last latch()
    std::size_t n_ = 0;
    // From couple() to accelerate(): where each is, two directions perpendicular to its rod, and the motion along them.
    Vec3 place_[SLOSH_MAX]{};
    Vec3 across_[SLOSH_MAX][2]{};
    Freedom now_[SLOSH_MAX][2]{};
};

} // namespace fledge::world

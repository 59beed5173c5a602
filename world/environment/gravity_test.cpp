// SPDX-License-Identifier: Apache-2.0
#include "world/environment/gravity.h"

#include "sim/error.h"
#include "world/eigen.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace gravity_test {

using namespace fledge::world;
using Eigen::Vector3d;

/// The gradient of the potential by central differences, to order 4 in the step.
Vector3d gradient(const GravityBody &body, const Vector3d &r)
{
    const double h = 1e-3 * r.norm();
    Vector3d g;
    for (int i = 0; i < 3; i++) {
        const Vector3d step = h * Vector3d::Unit(i);
        const auto slope = [&](double k) {
            return gravity_potential(body, r + k * step) - gravity_potential(body, r - k * step);
        };
        g[i] = (8.0 * slope(1.0) - slope(2.0)) / (12.0 * h);
    }
    return g;
}

TEST(Gravity, EachHarmonicIsTheGradientOfThePotential)
{
    std::mt19937_64 engine(7);
    std::uniform_real_distribution<double> in(-1.0, 1.0);
    for (std::size_t k = 0; k < 6; k++) {
        for (int i = 0; i < 200; i++) {
            GravityBody body{.mu = 2.0, .radius = 1.0, .pole_N = {in(engine), in(engine), in(engine)}};
            if (k < 5) {
                body.J[k] = 0.3; // as strong as the point mass
            } else {
                body.J = {0.1, -0.2, 0.3, 0.2, -0.1};
            }
            body = checked(body);
            const Vector3d direction = Vector3d(in(engine), in(engine), in(engine)).normalized();
            const Vector3d r = (1.0 + std::abs(in(engine))) * direction;
            const Vector3d a = gravity(body, r);
            ASSERT_LT((a - gradient(body, r)).norm(), 1e-8 * (1.0 + a.norm())) << "J" << k + 2;
        }
    }
}

TEST(Gravity, WithoutHarmonicsItIsAPointMass)
{
    GravityBody body;
    body.mu = 4.2828314e13;
    const Vector3d r(3e6, -5e6, 2e6);
    const Vector3d expected = -body.mu / std::pow(r.norm(), 3) * r;
    EXPECT_LT((gravity(body, r) - expected).norm(), 1e-15 * expected.norm());
    const Vec3 point = point_mass_gravity(body.mu, vec(r));
    EXPECT_LT((view(point) - expected).norm(), 1e-15 * expected.norm());
    EXPECT_DOUBLE_EQ(gravity_potential(body, r), body.mu / r.norm());
}

TEST(Gravity, AnOblateBodyPullsToItsEquator)
{
    // On the equator J2 adds 3/2 J2 (R / r)^2 of the point mass; over the pole it takes off twice
    // that.
    GravityBody body{.mu = 1.0, .radius = 1.0};
    body.J[0] = 0.01;
    EXPECT_NEAR(gravity(body, {2, 0, 0})[0], -0.25 * (1.0 + 1.5 * 0.01 / 4.0), 1e-15);
    EXPECT_NEAR(gravity(body, {0, 0, 2})[2], -0.25 * (1.0 - 3.0 * 0.01 / 4.0), 1e-15);
}

TEST(Gravity, BadBodiesAreRefused)
{
    GravityBody good{.name = "mars", .mu = 1.0};
    const auto message = [&](const std::function<void(GravityBody &)> &spoil) {
        GravityBody body = good;
        spoil(body);
        return error_of([&] { checked(body); });
    };
    EXPECT_EQ(message([](auto &b) { b.mu = 0.0; }), "gravity body mars: mu must be > 0; found 0");
    EXPECT_EQ(message([](auto &b) { b.mu = NAN; }), "gravity body mars: mu must be > 0; found nan");
    EXPECT_EQ(message([](auto &b) { b.J[2] = 1e-6; }), "gravity body mars: zonal harmonics need a radius; found 0");
    EXPECT_EQ(message([](auto &b) { b.radius = -1.0; }), "gravity body mars: radius must be >= 0; found -1");
    EXPECT_EQ(message([](auto &b) { b.J[1] = INFINITY; }), "gravity body mars: J3 must be finite; found inf");
    EXPECT_EQ(message([](auto &b) { b.pole_N.setZero(); }),
              "gravity body mars: the pole must have a direction, so a length > 0; found 0");
    EXPECT_EQ(message([](auto &b) { b.v_PN_N[1] = INFINITY; }),
              "gravity body mars: position and velocity must be finite; found inf");
    EXPECT_EQ(message([](auto &b) { b.name = "", b.mu = -2.0; }), "gravity body (no name): mu must be > 0; found -2");
    good.pole_N = {0, 3, 4};
    EXPECT_LT((checked(good).pole_N - Vector3d(0, 0.6, 0.8)).norm(), 1e-15);
}

} // namespace gravity_test

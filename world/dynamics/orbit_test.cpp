// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/orbit.h"

#include "sim/error.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace orbit_test {

using namespace fledge::world;
using Eigen::Vector3d;

constexpr double pi = std::numbers::pi;
constexpr double mu = 3.986004418e14;

/// How far two states lie apart, relative to their size.
double apart(const OrbitState &a, const OrbitState &b)
{
    return std::max((a.r - b.r).norm() / b.r.norm(), (a.v - b.v).norm() / b.v.norm());
}

/// The difference of two angles, in [-pi, pi].
double turn(double a, double b)
{
    return std::remainder(a - b, 2.0 * pi);
}

TEST(Orbit, RandomConicsGoThereAndBack)
{
    std::mt19937_64 engine(1);
    std::uniform_real_distribution<double> in(0.0, 1.0);
    for (int k = 0; k < 5000; k++) {
        OrbitElements a;
        a.p = 1e6 * std::pow(10.0, 3.0 * in(engine));
        a.e = k % 5 == 0 ? 1.0 : k % 2 ? 0.02 + 0.96 * in(engine) : 1.02 + 3.0 * in(engine);
        a.i = 0.02 + (pi - 0.04) * in(engine);
        a.Omega = 2.0 * pi * in(engine);
        a.omega = 2.0 * pi * in(engine);
        const double limit = a.e < 1.0 ? pi : std::acos(-1.0 / a.e);
        a.f = 0.95 * limit * (2.0 * in(engine)-1.0);
        const OrbitState state = orbit_state(mu, a);
        const OrbitElements b = orbit_elements(mu, state);
        ASSERT_NEAR(b.p / a.p, 1.0, 1e-12);
        ASSERT_NEAR(b.e, a.e, 1e-12);
        ASSERT_NEAR(b.i, a.i, 1e-12);
        ASSERT_NEAR(turn(b.Omega, a.Omega), 0.0, 1e-11);
        ASSERT_NEAR(turn(b.omega, a.omega), 0.0, 1e-10);
        ASSERT_NEAR(turn(b.f, a.f), 0.0, 1e-10);
        ASSERT_LT(apart(orbit_state(mu, b), state), 1e-12);
        for (const double angle : {b.Omega, b.omega}) {
            ASSERT_TRUE(angle >= 0.0 && angle < 2.0 * pi) << angle;
        }
    }
}

TEST(Orbit, RandomStatesGoThereAndBack)
{
    std::mt19937_64 engine(2);
    std::normal_distribution<double> in;
    for (int k = 0; k < 5000; k++) {
        const OrbitState state{7e6 * Vector3d(in(engine), in(engine), in(engine)),
                               7e3 * Vector3d(in(engine), in(engine), in(engine))};
        ASSERT_LT(apart(orbit_state(mu, orbit_elements(mu, state)), state), 1e-10) << k;
    }
}

TEST(Orbit, TheStateHasTheElementsEnergyAndMomentum)
{
    for (const double e : {0.0, 0.3, 0.99, 1.0, 1.01, 3.0}) {
        const OrbitElements elements{.p = 1e7, .e = e, .i = 1.0, .Omega = 2.0, .omega = 3.0, .f = 0.7};
        const auto [r, v] = orbit_state(mu, elements);
        EXPECT_NEAR(v.squaredNorm() / 2.0 - mu / r.norm(), -mu * (1.0 - e * e) / 2e7, 1e-6);
        const Vector3d h = r.cross(v);
        EXPECT_NEAR(h.norm() / std::sqrt(mu * 1e7), 1.0, 1e-14);
        EXPECT_NEAR(h[2] / h.norm(), std::cos(1.0), 1e-14);
        // The node is where the orbit crosses upwards: normal x (cos Omega, sin Omega, 0) rises.
        EXPECT_NEAR(h.dot(Vector3d(std::cos(2.0), std::sin(2.0), 0.0)) / h.norm(), 0.0, 1e-14);
        EXPECT_GT(h.cross(Vector3d(std::cos(2.0), std::sin(2.0), 0.0))[2], 0.0);
        EXPECT_GT(r.dot(v) + 1e-3, 0.0); // f in (0, pi): on the way out
    }
}

TEST(Orbit, KnownPlaces)
{
    // At periapsis on the first axis, going along the second.
    const auto [r, v] = orbit_state(mu, {.p = 1.5e7, .e = 0.5});
    EXPECT_LT((r - Vector3d(1e7, 0, 0)).norm(), 1e-8);
    EXPECT_LT((v - Vector3d(0, std::sqrt(mu / 1e7 * 1.5), 0)).norm(), 1e-11);
    // A polar orbit a quarter turn after its node is over the pole.
    const auto [top, along] = orbit_state(mu, {.p = 1e7, .i = pi / 2, .Omega = 1.0, .f = pi / 2});
    EXPECT_LT((top - Vector3d(0, 0, 1e7)).norm(), 1e-8);
    EXPECT_LT((along.normalized() + Vector3d(std::cos(1.0), std::sin(1.0), 0)).norm(), 1e-14);
}

TEST(Orbit, DegenerateConicsGoThereAndBack)
{
    for (const double e : {0.0, 1e-13, 1e-10, 1e-6, 0.5, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.0}) {
        for (const double i : {0.0, 1e-13, 1e-9, 1e-5, pi / 2, pi - 1e-9, pi}) {
            for (const double f : {-1.5, 0.0, 1.0}) {
                const OrbitElements a{.p = 1e7, .e = e, .i = i, .Omega = 1.0, .omega = 2.0, .f = f};
                const OrbitState state = orbit_state(mu, a);
                const OrbitElements b = orbit_elements(mu, state);
                EXPECT_LT(apart(orbit_state(mu, b), state), 5e-12) << e << " " << i << " " << f;
                if (i < 1e-12 || i > pi - 1e-12) {
                    EXPECT_EQ(b.Omega, 0.0);
                }
                if (e < 1e-12) {
                    EXPECT_EQ(b.e, 0.0);
                    EXPECT_EQ(b.omega, 0.0);
                }
            }
        }
    }
    EXPECT_EQ(orbit_elements(mu, orbit_state(mu, {.p = 1e7, .e = 1.0, .f = -1.0})).e, 1.0);
}

TEST(Orbit, DegenerateElementsAreWhatTheHeaderSays)
{
    const double v = std::sqrt(mu / 1e7);
    // Circular and equatorial: from the first axis, forwards and backwards.
    const auto forwards = orbit_elements(mu, {{0, 1e7, 0}, {-v, 0, 0}});
    EXPECT_NEAR(forwards.f, pi / 2, 1e-15);
    EXPECT_EQ(forwards.i, 0.0);
    const auto backwards = orbit_elements(mu, {{0, 1e7, 0}, {v, 0, 0}});
    EXPECT_NEAR(backwards.f, 1.5 * pi, 1e-15);
    EXPECT_NEAR(backwards.i, pi, 1e-15);
    // An open orbit has its anomaly on both sides of periapsis, a closed one in [0, 2 pi).
    EXPECT_NEAR(orbit_elements(mu, orbit_state(mu, {.p = 1e7, .e = 2.0, .f = -1.0})).f, -1.0, 1e-14);
    EXPECT_NEAR(orbit_elements(mu, orbit_state(mu, {.p = 1e7, .e = 0.5, .f = -1.0})).f, 2.0 * pi - 1.0, 1e-14);
}

TEST(Orbit, SemiMajorAxis)
{
    EXPECT_DOUBLE_EQ(semi_latus_rectum(1e7, 0.5), 0.75e7);
    EXPECT_DOUBLE_EQ(semi_latus_rectum(-1e7, 2.0), 3e7);
    EXPECT_DOUBLE_EQ((OrbitElements{.p = 3e7, .e = 2.0}.semi_major_axis()), -1e7);
    EXPECT_TRUE(std::isinf(OrbitElements{.p = 3e7, .e = 1.0}.semi_major_axis()));
    EXPECT_EQ(error_of([] { semi_latus_rectum(1e7, 1.0); }),
              "orbit: a parabola has no semi-major axis: give its semi-latus rectum; found 1");
    EXPECT_EQ(error_of([] { semi_latus_rectum(1e7, 1.5); }),
              "orbit: a hyperbola (e > 1) needs a semi-major axis < 0; found 1e+07");
    EXPECT_EQ(error_of([] { semi_latus_rectum(-5.0, 0.5); }),
              "orbit: an ellipse (e < 1) needs a semi-major axis > 0; found -5");
    EXPECT_THROW(semi_latus_rectum(1e7, -0.1), fledge::sim::SetupError);
    EXPECT_THROW(semi_latus_rectum(0.0, 0.1), fledge::sim::SetupError);
    EXPECT_THROW(semi_latus_rectum(NAN, 0.1), fledge::sim::SetupError);
}

TEST(Orbit, WhatIsNoOrbitIsRefused)
{
    const OrbitElements good{.p = 1e7, .e = 0.1};
    const auto message = [&](auto spoil) {
        OrbitElements elements = good;
        spoil(elements);
        return error_of([&] { orbit_state(mu, elements); });
    };
    EXPECT_EQ(error_of([&] { orbit_state(0.0, good); }), "orbit: mu must be > 0; found 0");
    EXPECT_EQ(message([](auto &x) { x.p = 0.0; }), "orbit: the semi-latus rectum must be > 0; found 0");
    EXPECT_EQ(message([](auto &x) { x.e = -0.1; }), "orbit: the eccentricity must be >= 0; found -0.1");
    EXPECT_EQ(message([](auto &x) { x.i = NAN; }), "orbit: the inclination must be finite; found nan");
    EXPECT_EQ(message([](auto &x) { x.e = 2.0, x.f = 2.5; }),
              "orbit: with an eccentricity of 2 the true anomaly must be between the asymptotes, "
              "+-2.0943951023931957 rad; found 2.5");
    EXPECT_NE(message([](auto &x) { x.e = 1.0, x.f = pi; }), "");
    EXPECT_NE(message([](auto &x) { x.Omega = INFINITY; }), "");
    EXPECT_NE(message([](auto &x) { x.omega = NAN; }), "");
    EXPECT_NE(message([](auto &x) { x.f = NAN; }), "");

    EXPECT_EQ(error_of([] {
                  orbit_elements(mu, {{1e7, 0, 0}, {5e3, 0, 0}});
              }),
              "orbit: position and velocity lie along one line; a rectilinear orbit has no "
              "classical elements");
    EXPECT_THROW(orbit_elements(mu, {{1e7, 0, 0}, {0, 0, 0}}), fledge::sim::SetupError);
    EXPECT_THROW(orbit_elements(mu, {{0, 0, 0}, {1, 0, 0}}), fledge::sim::SetupError);
    EXPECT_THROW(orbit_elements(mu, {{1e7, 0, 0}, {0, NAN, 0}}), fledge::sim::SetupError);
    EXPECT_THROW(orbit_elements(-mu, {{1e7, 0, 0}, {0, 1e3, 0}}), fledge::sim::SetupError);
}

} // namespace orbit_test

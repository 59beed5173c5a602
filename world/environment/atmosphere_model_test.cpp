// SPDX-License-Identifier: Apache-2.0
#include "world/environment/atmosphere_model.h"

#include "world/eigen.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/two_circles.h"

#include <Eigen/Dense>

#include <random>

namespace fledge::world {
namespace atmosphere_model_test {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::TwoCircles;

constexpr sim::Ns second = 1'000'000'000;

struct Sphere : ::testing::Test {
    Atmosphere i{};
    AtmosphereModel model{i};

    Sphere()
    {
        GravityBody body{.name = "ROCK",
                         .mu = 4e14,
                         .radius = 6.4e6,
                         .pole_N = {1.0, 2.0, 2.0},
                         .r_PN_N = {1e7, 2e7, -3e7},
                         .v_PN_N = {100.0, -200.0, 300.0}};
        model.set_body(body);
        i.par.law = ATMOSPHERE_EXPONENTIAL;
        i.par.density = 1.2;
        i.par.base = 1000.0;
        i.par.scale_height = 8000.0;
        i.par.spin = 7e-5;
    }
    std::string refusal()
    {
        return error_of([&] { model.prepare({"world.air", 1, nullptr}); });
    }
};

TEST_F(Sphere, IsThinnerByAFactorEPerScaleHeightAndTurnsWithTheBody)
{
    ASSERT_EQ(refusal(), "");
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const Vector3d pole = Vector3d(1, 2, 2) / 3.0;
    for (int round = 0; round < 100; round++) {
        const double tau = 10.0 * round;
        const Vector3d direction = Vector3d(normal(random), normal(random), normal(random)).normalized();
        const Vector3d arm = (6.4e6 + 1000.0 + 8000.0 * round / 10.0) * direction;
        const Vector3d body = Vector3d(1e7, 2e7, -3e7) + tau * Vector3d(100, -200, 300);
        const auto air = model.at(0, tau, body + arm);
        EXPECT_NEAR(air.altitude, 1000.0 + 800.0 * round, 1e-6);
        EXPECT_NEAR(air.density / (1.2 * std::exp(-0.1 * round)), 1.0, 1e-9);
        EXPECT_LT((air.velocity_N - Vector3d(100, -200, 300) - 7e-5 * pole.cross(arm)).norm(), 1e-9);
    }
}

TEST_F(Sphere, PublishesWhatPartsAreAnswered)
{
    ASSERT_EQ(refusal(), "");
    model.reset(0);
    model.update({0, 0});
    EXPECT_EQ(i.out.air.head.quality, QUALITY_NONE) << "without a place there is no air";
    i.in.truth.head.quality = QUALITY_GOOD;
    i.in.truth.r_BN_N = vec3(1e7, 2e7, -3e7 + 6.5e6);
    model.update({50 * second, 50 * second});
    const auto air = model.at(50 * second, 0.0, view(i.in.truth.r_BN_N));
    EXPECT_EQ(i.out.air.density, air.density);
    EXPECT_EQ(i.out.air.altitude, air.altitude);
    EXPECT_EQ(Vector3d(view(i.out.air.v_AN_N)), air.velocity_N);
    EXPECT_EQ(i.out.air.head.t, 50 * second);
    i.in.truth.head.quality = QUALITY_STALE;
    model.update({51 * second, second});
    EXPECT_EQ(i.out.air.head.quality, QUALITY_DEGRADED);
}

TEST_F(Sphere, InASkyItMovesAndTurnsAsTheSkySays)
{
    model.set_body({.name = "JUPITER", .mu = TwoCircles::mu_jupiter, .radius = 7.1492e7, .naif = TwoCircles::jupiter});
    const auto sky = TwoCircles::sky(TwoCircles::sun, 2.0);
    model.set_sky(sky);
    EXPECT_EQ(refusal(), "world.air.spin: the sky says how JUPITER turns; found 7e-05 rad/s");
    i.par.spin = 0.0;
    ASSERT_EQ(refusal(), "");
    const double t = 2.0 * TwoCircles::day + 1234.5;
    const Vector3d r = TwoCircles::r(TwoCircles::jupiter, t) - TwoCircles::r(TwoCircles::sun, t);
    const Vector3d v = TwoCircles::v(TwoCircles::jupiter, t) - TwoCircles::v(TwoCircles::sun, t);
    const BodyAttitude turned = sky->orientation(TwoCircles::jupiter).at(sky->epoch_at(1234 * second), 0.5);
    const Vector3d pole = turned.dcm_PN.row(2), arm(8e7, 1e7, -3e7);
    const auto air = model.at(1234 * second, 0.5, r + arm);
    const double rate = turned.omega_PN_P.norm();
    EXPECT_NEAR(rate, 2 * std::numbers::pi / (9.925 * 3600.0), 1e-7); // it does turn
    EXPECT_LT((air.velocity_N - v - rate * pole.cross(arm)).norm(), 0.01);
    // Over the poles the ellipsoid is lower by its flattening, 4638 km.
    EXPECT_NEAR(model
                    .at(0, 0.0,
                        model.sky()->position(TwoCircles::jupiter, 0, 0.0, *std::make_unique<Ephemeris::Cursor>()) +
                            8e7 * Vector3d(sky->orientation(TwoCircles::jupiter).at(sky->epoch_at(0)).dcm_PN.row(2)))
                    .altitude,
                8e7 - 66854e3, 1e3);
    EXPECT_THAT(error_of([&] { model.ensure_data_until(30 * 86400 * second); }), HasSubstr("world.air: JUPITER (599)"));
}

TEST_F(Sphere, NamesWhatIsWrong)
{
    i.par.scale_height = 0.0;
    EXPECT_EQ(refusal(), "world.air.scale_height must be >= 1 m for the exponential law; found 0 m");
    i.par.law = ATMOSPHERE_STANDARD_1976;
    EXPECT_THAT(refusal(), HasSubstr("world.air.density: the standard atmosphere has its own; found 1.2 kg/m^3"));
    i.par.law = ATMOSPHERE_CONSTANT;
    EXPECT_EQ(refusal(), "");
    i.par.density = 0.0;
    EXPECT_EQ(refusal(), "world.air.density must be > 0 kg/m^3, but for the law STANDARD_1976; found 0 kg/m^3");
    i.par.density = 1.2;
    GravityBody small{.name = "DUST", .mu = 1.0};
    model.set_body(small);
    EXPECT_EQ(refusal(), "world.air: DUST has no radius");
    model.set_sky(TwoCircles::sky(TwoCircles::sun));
    small.radius = 1.0;
    model.set_body(small);
    EXPECT_EQ(refusal(), "world.air: DUST has no NAIF number, by which the sky would find it");
    AtmosphereModel bare(i);
    EXPECT_EQ(error_of([&] {
                  bare.prepare({"world.air", 1, nullptr});
              }),
              "world.air.body is missing: give it a body, as in body=world.EARTH");
}

} // namespace atmosphere_model_test
} // namespace fledge::world

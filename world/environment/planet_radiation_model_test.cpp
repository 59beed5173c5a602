// SPDX-License-Identifier: Apache-2.0
// View factors and the phase of a Lambert sphere in closed form, and the energy that leaves a body.
#include "tests/error_of.h"
#include "world/eigen.h"
#include "world/environment/testing/shine.h"
#include "world/environment/testing/two_circles.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace fledge::world {
namespace planet_radiation_model_test {

using Eigen::Vector3d;

constexpr double pi = std::numbers::pi;

struct Shine : ::testing::Test, testing::Shine {
    /// The sums of irradiances times directions.
    struct Flux {
        Vector3d reflected{0, 0, 0}, infrared{0, 0, 0};
    };
    Flux flux(const Vector3d &r) const
    {
        Flux sum;
        for (const auto &element : model.at(0, 0.0, r)) {
            sum.reflected += element.reflected * element.towards_N;
            sum.infrared += element.infrared * element.towards_N;
        }
        return sum;
    }

    /// The power [W] that leaves through a sphere of this radius about the planet, by Simpson's rule over the angle
    /// from an axis of symmetry, times four.
    Flux power(double radius, const Vector3d &axis) const
    {
        constexpr int n = 400;
        Flux sum;
        for (int k = 0; k <= n; k++) {
            const double angle = pi * k / n, ring = 2 * pi * radius * radius * std::sin(angle) * pi / n / 3;
            const Vector3d up = std::cos(angle) * axis + std::sin(angle) * axis.unitOrthogonal();
            const double weight = (k == 0 || k == n ? 1.0 : k % 2 ? 4.0 : 2.0) * ring;
            const Flux here = flux(radius * up);
            sum.reflected[0] -= weight * here.reflected.dot(up);
            sum.infrared[0] -= weight * here.infrared.dot(up);
        }
        return sum;
    }
};

TEST_F(Shine, OfAUniformSphereIsItsViewFactor)
{
    // A plate that faces a sphere of the angular radius a, all in its view, receives sin^2 a of what leaves the sphere.
    i.par.emissivity = 0.7;
    prepare();
    for (const unsigned rings : {1u, 2u, 3u, 4u, 5u}) {
        i.par.rings = rings;
        for (const double distance : {1.0001 * R, 1.1 * R, 2.0 * R, 60.0 * R}) {
            for (const Vector3d &up : {Vector3d(1, 0, 0), Vector3d(-1, 0, 0), Vector3d(0.48, 0.6, -0.64)}) {
                const Flux found = flux(distance * up);
                const double wanted = 0.7 * E / 4.0 * (R / distance) * (R / distance);
                EXPECT_LT((found.infrared + wanted * up).norm(), 1e-12 * wanted) << rings << " " << distance;
                EXPECT_EQ(found.reflected.norm(), 0.0);
            }
        }
    }
}

TEST_F(Shine, FromAfarHasThePhasesOfALambertSphere)
{
    i.par.albedo = 0.3;
    prepare();
    const double distance = 1000.0 * R;
    double worst[6] = {};
    for (const unsigned rings : {1u, 3u, 5u}) {
        i.par.rings = rings;
        for (double phase = 0.0; phase < 3.1; phase += 0.1) {
            const Vector3d up(std::cos(phase), 0.6 * std::sin(phase), 0.8 * std::sin(phase));
            const double full = 2.0 / 3.0 * 0.3 * E * (R / distance) * (R / distance);
            const double wanted = full * (std::sin(phase) + (pi - phase) * std::cos(phase)) / pi;
            worst[rings] = std::max(worst[rings], std::abs(flux(distance * up).reflected.norm() - wanted) / full);
        }
    }
    EXPECT_LT(worst[5], 0.02);
    EXPECT_LT(worst[5], 0.7 * worst[3]);
    EXPECT_LT(worst[3], 0.7 * worst[1]);
}

TEST_F(Shine, CarriesAwayWhatTheSunBrings)
{
    i.par.albedo = 0.3;
    i.par.emissivity = 0.7;
    prepare();
    const double sun = E * pi * R * R;
    for (const double radius : {1.05 * R, 2.0 * R, 10.0 * R}) {
        double error[6] = {};
        for (const unsigned rings : {1u, 2u, 5u}) {
            i.par.rings = rings;
            const Flux found = power(radius, Vector3d::UnitX());
            error[rings] = std::abs(found.reflected[0] / (0.3 * sun) - 1.0);
            EXPECT_NEAR(found.infrared[0] / (0.7 * sun), 1.0, 1e-8);
        }
        EXPECT_LT(error[2], 0.02) << radius;
        EXPECT_LT(error[5], 0.008) << radius;
        EXPECT_LT(error[5], error[1]) << radius;
    }
}

TEST_F(Shine, AtNightIsInfraredAlone)
{
    i.par.albedo = 0.3;
    i.par.emissivity = 0.7;
    prepare();
    EXPECT_EQ(flux({-1.1 * R, 0, 0}).reflected.norm(), 0.0);
    EXPECT_GT(flux({-1.1 * R, 0, 0}).infrared.norm(), 100.0);
    EXPECT_GT(flux({1.1 * R, 0, 0}).reflected.norm(), 200.0);
    EXPECT_TRUE(model.at(0, 0.0, {0.9 * R, 0, 0}).empty());
}

TEST_F(Shine, HasElementsThatLookEquallyLargeAndLieOnTheBody)
{
    i.par.emissivity = 1.0;
    i.par.albedo = 0.5;
    prepare();
    const Vector3d r = 1.3 * R * Vector3d(0.6, 0.48, 0.64);
    for (const unsigned rings : {0u, 1u, 5u}) {
        i.par.rings = rings;
        const auto elements = model.at(0, 0.0, r);
        ASSERT_EQ(elements.size(), rings == 0 ? 19u : rings == 1 ? 7u : 91u);
        for (const auto &element : elements) {
            EXPECT_NEAR(element.towards_N.norm(), 1.0, 1e-14);
            EXPECT_LT(r.cross(element.towards_N).norm(), R) << "the line of sight meets the body";
            EXPECT_NEAR(element.infrared, elements.back().infrared, (&element == elements.data() ? 0.1 : 1e-9) * E);
            // Its mirror image in the plane of the Sun is there, too.
            const Vector3d across = r.cross(Vector3d::UnitX()).normalized();
            const Vector3d image = element.towards_N - 2.0 * across.dot(element.towards_N) * across;
            double nearest = 1.0, difference = 1.0;
            for (const auto &other : elements) {
                if ((other.towards_N - image).norm() < nearest) {
                    nearest = (other.towards_N - image).norm();
                    difference = other.reflected - element.reflected;
                }
            }
            EXPECT_LT(nearest, 1e-7);
            EXPECT_LT(std::abs(difference), 1e-6);
        }
    }
}

TEST_F(Shine, OfTheEarthFollowsLatitudeAndSeason)
{
    // Jupiter stands for the Earth here, for it has a pole in this sky; close over the ground its own brightness is
    // all that is seen. 22 December is 10 days before the sky begins.
    using testing::TwoCircles;
    GravityBody planet = model.bodies()[0], sun = light.bodies()[0];
    planet.naif = TwoCircles::jupiter;
    sun.naif = TwoCircles::sun;
    sun.r_PN_N = {0, 0, 0};
    const auto sky = TwoCircles::sky(TwoCircles::jupiter);
    Sunlight lights{};
    SunlightModel sunlight(lights);
    PlanetRadiation shines{};
    PlanetRadiationModel shine(shines);
    sunlight.set_body(sun);
    sunlight.set_sky(sky);
    shine.set_body(planet);
    shine.set_sky(sky);
    shine.set_source(sunlight);
    shines.par.law = PLANET_RADIATION_KNOCKE_1988;
    sunlight.prepare({"world.light", 1, nullptr});
    shine.prepare({"world.shine", 1, nullptr});
    shine.reset(0);
    const double season = std::cos(2 * pi * 11.0 / 365.25); // at the 2 January 2000, 12 h, and 18 years before
    const Eigen::Matrix3d dcm_PN = sky->orientation(TwoCircles::jupiter).dcm_PN(sky->epoch_at(0));
    const auto E_there = sunlight.unhidden(0, 0.0, {0, 0, 0});
    double power = 0.0;
    constexpr int n = 200;
    for (int k = 0; k < n; k++) {
        const double s = (k + 0.5) / n * 2 - 1, P2 = (3 * s * s - 1) / 2, c = std::sqrt(1 - s * s);
        const Vector3d up = dcm_PN.transpose() * Vector3d(0.6 * c, 0.8 * c, s);
        shines.in.truth.head.quality = QUALITY_GOOD;
        shines.in.truth.r_BN_N = vec((R + 1.0) * up);
        shine.update({0, 0});
        const PlanetLight &found = shines.out.planet;
        EXPECT_EQ(found.sunlight, E_there.irradiance);
        const double emissivity = 0.68 - 0.07 * season * s - 0.18 * P2, albedo = 0.34 + 0.10 * season * s + 0.29 * P2;
        const double lit = std::max(up.dot(E_there.s_N), 0.0);
        EXPECT_NEAR(view(found.infrared_N).norm() / found.sunlight, emissivity / 4, 1e-3);
        EXPECT_NEAR(view(found.reflected_N).norm() / found.sunlight, albedo * lit, 1e-3);
        power += 4 * view(found.infrared_N).norm() / found.sunlight / n;
    }
    EXPECT_NEAR(power, 0.68, 1e-3) << "over all latitudes the other terms cancel";
}

TEST_F(Shine, NamesWhatIsWrong)
{
    const auto refusal = [&] { return error_of([&] { prepare(); }); };
    EXPECT_EQ(refusal(),
              "world.shine.albedo and .emissivity are 0: the body sends no light. Give at least one, or take "
              "the law KNOCKE_1988 of the Earth");
    i.par.law = PLANET_RADIATION_KNOCKE_1988;
    EXPECT_EQ(refusal(), "world.shine.law: KNOCKE_1988 depends on the season: give the model a sky, as in "
                         "sky=world.Sky(...), or take the law CONSTANT");
    i.par.law = PLANET_RADIATION_CONSTANT;
    i.par.albedo = 0.3;
    prepare();
    light.set_sky(testing::TwoCircles::sky(testing::TwoCircles::sun));
    EXPECT_EQ(error_of([&] { model.reset(0); }), "world.shine.light: the Sunlight must be in the same sky");
    PlanetRadiation other{};
    other.par.albedo = 0.3;
    PlanetRadiationModel bare(other);
    bare.set_body(model.bodies()[0]);
    bare.prepare({"world.shine", 1, nullptr});
    EXPECT_EQ(error_of([&] { bare.reset(0); }),
              "world.shine.light is missing: a model of the same world, as in `w.light = world.Sunlight(...)`");
    EXPECT_FALSE(bare.set_source(model));
}

} // namespace planet_radiation_model_test
} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/solar_array_model.h"

#include "tests/error_of.h"
#include "world/environment/testing/shine.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

namespace solar_array_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

TEST(SolarArray, GivesWhatItsLitPanelsConvert)
{
    SolarArray i{};
    SolarArrayModel model{i};
    i.par.n = 2;
    i.par.normals_B[0] = vec3(0, 0, 2);
    i.par.normals_B[1] = vec3(0, 1, 0);
    i.par.areas[0] = 2.0;
    i.par.areas[1] = 0.5;
    i.par.efficiency = 0.3;
    i.in.truth.head.quality = i.in.light.head.quality = QUALITY_GOOD;
    i.in.light.irradiance = 1361.0;
    // The body turns about x: panel 0 follows the cosine, panel 1 comes into the light as panel 0 turns away.
    for (double angle = 0.0; angle < 6.28; angle += 0.1) {
        i.in.truth.sigma_BN = vec3(std::tan(angle / 4.0), 0, 0);
        i.in.light.s_N = vec3(0, 0, 1);
        model.update({0, 0});
        const double wanted =
            0.3 * 1361.0 * (2.0 * std::max(std::cos(angle), 0.0) + 0.5 * std::max(std::sin(angle), 0.0));
        EXPECT_NEAR(i.out.array.power, wanted, 1e-9) << angle;
    }
    i.in.light.irradiance = 0.0; // an eclipse
    model.update({0, 0});
    EXPECT_EQ(i.out.array.power, 0.0);
    i.in.light.head.quality = QUALITY_STALE;
    model.update({0, 0});
    EXPECT_EQ(i.out.array.head.quality, QUALITY_DEGRADED);
}

TEST(SolarArray, ConvertsWhatAPlanetReflectsToo)
{
    Shine shine;
    shine.i.par.albedo = 0.3;
    shine.i.par.emissivity = 0.7; // cells do not use it
    shine.prepare();
    SolarArray i{};
    SolarArrayModel model{i};
    const Vector3d up(0.8, 0.6, 0), r = 1.2 * Shine::R * up;
    Vector3d reflected(0, 0, 0);
    double across = 0.0;
    for (const auto &element : shine.model.at(0, 0.0, r)) {
        reflected += element.reflected * element.towards_N;
        across += element.reflected * std::max(element.towards_N[2], 0.0);
    }
    i.in.truth.sigma_BN = vec3(std::tan(0.3 / 4.0), 0, 0); // about x
    i.in.truth.r_BN_N = vec(r);
    const auto turned = [](double x, double y, double z) {
        return vec3(x, std::cos(0.3) * y + std::sin(0.3) * z, std::cos(0.3) * z - std::sin(0.3) * y);
    };
    i.par.n = 2;
    i.par.normals_B[0] = turned(-0.8, -0.6, 0); // sees all of the planet, and not the Sun
    i.par.normals_B[1] = turned(0, 0, 1);       // a part of it
    i.par.areas[0] = 2.0;
    i.par.efficiency = 0.3;
    i.in.truth.head.quality = i.in.light.head.quality = QUALITY_GOOD;
    i.in.light.irradiance = 1361.0;
    i.in.light.s_N = vec3(1, 0, 0);
    EXPECT_TRUE(model.set_source(shine.model));
    model.prepare({"world.array", 1, nullptr});
    model.reset(0);
    model.update({0, 0});
    EXPECT_NEAR(i.out.array.power, 0.3 * 2.0 * -up.dot(reflected), 1e-9);
    EXPECT_GT(i.out.array.power, 50.0);
    i.par.areas[1] = 3.0;
    model.update({0, 0});
    EXPECT_NEAR(i.out.array.power, 0.3 * (2.0 * -up.dot(reflected) + 3.0 * across), 1e-9);
    EXPECT_GT(across, 10.0);
    model.prepare({"other.array", 1, nullptr});
    EXPECT_EQ(error_of([&] { model.reset(0); }), "other.array.radiation is a model outside of the same world, as in "
                                                 "`w.radiation = world.PlanetRadiation(...)`");
}

TEST(SolarArray, APanelIsTurnedAboutItsAxis)
{
    SolarArray i{};
    SolarArrayModel model{i};
    i.par.n = 2;
    i.par.normals_B[0] = i.par.normals_B[1] = vec3(0, 0, 1);
    i.par.axes_B[1] = vec3(0, 3, 0);
    i.par.areas[0] = 0.1;
    i.par.areas[1] = 2.0;
    i.par.efficiency = 1.0;
    i.in.truth.head.quality = i.in.light.head.quality = QUALITY_GOOD;
    i.in.light.irradiance = 1.0;
    i.in.angles.head.quality = QUALITY_GOOD;
    i.in.light.s_N = vec3(std::sin(0.4), 0, std::cos(0.4));
    for (double angle = -7.0; angle < 7.0; angle += 0.1) { // about +y, z turns towards x
        i.in.angles.theta[0] = i.in.angles.theta[1] = angle;
        model.update({0, 0});
        EXPECT_NEAR(i.out.array.power, 0.1 * std::cos(0.4) + 2.0 * std::max(std::cos(angle - 0.4), 0.0), 1e-12);
    }
}

} // namespace solar_array_model_test

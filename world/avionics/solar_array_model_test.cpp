// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/solar_array_model.h"

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
    SolarArray i{};
    SolarArrayModel model{i};
    i.par.n = 2;
    i.par.normals_B[0] = vec3(0, 0, 1);
    i.par.normals_B[1] = vec3(0, 0, -1);
    i.par.areas[0] = i.par.areas[1] = 2.0;
    i.par.efficiency = 0.3;
    i.in.truth.head.quality = i.in.light.head.quality = i.in.planet.head.quality = QUALITY_GOOD;
    i.in.light.irradiance = 1361.0;
    i.in.light.s_N = vec3(0, 0, 1);
    i.in.planet.n = 2;
    i.in.planet.towards_N[0] = vec3(0, 0.6, -0.8);
    i.in.planet.towards_N[1] = vec3(0.8, 0, 0.6);
    i.in.planet.reflected[0] = 300.0;
    i.in.planet.reflected[1] = 10.0;
    i.in.planet.infrared[0] = 200.0; // cells do not use it
    model.update({0, 0});
    EXPECT_NEAR(i.out.array.power, 0.3 * 2.0 * (1361.0 + 0.8 * 300.0 + 0.6 * 10.0), 1e-9);
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

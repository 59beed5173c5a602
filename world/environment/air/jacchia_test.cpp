// SPDX-License-Identifier: Apache-2.0
// Against the laws of which the air is made: by numerical derivatives and by the conditions at its joints.
#include "world/environment/air/jacchia.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fledge::world {
namespace jacchia_test {

constexpr double exospheres[] = {600.0, 1000.0, 1900.0};
constexpr double base = 2.1926e-5, argon = 0.0093432;

TEST(JacchiaAir, HasTheTemperaturesAtItsJoints)
{
    for (const double exosphere : exospheres) {
        const JacchiaAir air(exosphere);
        EXPECT_NEAR(air.temperature(90.0), 183.0, 1e-9);
        EXPECT_NEAR(air.temperature(90.001), 183.0, 1e-4); // level there
        const double at_125 = air.temperature(125.0);
        EXPECT_NEAR(at_125, 444.3807 + 0.02385 * exosphere - 392.8292 * std::exp(-0.0021357 * exosphere), 1e-9);
        const double h = 1e-4;
        EXPECT_NEAR((air.temperature(125.0 + h) - at_125) / h, (at_125 - air.temperature(125.0 - h)) / h,
                    2e-5 * at_125);
        EXPECT_NEAR((at_125 - air.temperature(125.0 - h)) / h, 1.9 * (at_125 - 183.0) / 35.0, 1e-5 * at_125);
        EXPECT_NEAR(air.temperature(1e5), exosphere, 1e-3);
    }
}

TEST(JacchiaAir, EachSpeciesIsInDiffusiveEquilibrium)
{
    // d ln(n T^(1 + alpha)) / dz = -M g / (R T)
    const struct {
        double AirSpecies::*n;
        double M, alpha;
    } gases[] = {{&AirSpecies::N2, 28.0134, 0.0}, {&AirSpecies::O2, 31.9988, 0.0},  {&AirSpecies::O, 15.9994, 0.0},
                 {&AirSpecies::Ar, 39.948, 0.0},  {&AirSpecies::He, 4.0026, -0.38}, {&AirSpecies::H, 1.00797, 0.0}};
    for (const double exosphere : exospheres) {
        const JacchiaAir air(exosphere);
        for (double z = 106.0; z < 3000.0; z *= 1.037) {
            const double h = 1e-3 * z, r = 1.0 + z / 6356.766;
            const double weight = 1e3 * 9.80665 / (r * r * 8314.32 * air.temperature(z));
            AirSpecies above = air.species(z + h, base, argon), below = air.species(z - h, base, argon);
            above.H = air.hydrogen(z + h, exosphere);
            below.H = air.hydrogen(z - h, exosphere);
            const double warming = std::log(air.temperature(z + h) / air.temperature(z - h)) / (2.0 * h);
            for (const auto &gas : gases) {
                const double slope = std::log(above.*gas.n / (below.*gas.n)) / (2.0 * h);
                EXPECT_NEAR(slope + (1.0 + gas.alpha) * warming, -gas.M * weight, 3e-5 * (gas.M * weight + warming))
                    << z << " km, M " << gas.M;
            }
        }
    }
}

TEST(JacchiaAir, IsInHydrostaticEquilibriumWhereItIsMixed)
{
    const JacchiaAir air(1000.0);
    const auto pressure = [&](double z) {
        const AirComposition all = composition(air.species(z, base, argon), 1.0, air.temperature(z), 1000.0);
        return all.density / all.molar_mass * 8.31432 * all.temperature;
    };
    for (double z = 90.1; z < 104.9; z += 0.3) {
        const double h = 0.01, r = 1.0 + z / 6356.766;
        const double density = composition(air.species(z, base, argon), 1.0, air.temperature(z), 1000.0).density;
        const double slope = (pressure(z + h) - pressure(z - h)) / (2e3 * h);
        EXPECT_NEAR(slope / (density * 9.80665 / (r * r)), -1.0, 1e-4) << z;
    }
    // Jacchia 1970: 3.46e-6 kg/m^3 at 90 km.
    EXPECT_NEAR(pressure(90.0) / (8.31432 * 183.0) * 28.878082e-3, 3.46e-6, 3e-11);
}

TEST(JacchiaAir, SumsItsSpecies)
{
    AirSpecies species;
    species.He = 2e20;
    species.O = 1e20;
    const AirComposition all = composition(species, 0.5, 900.0, 1000.0);
    EXPECT_NEAR(all.density, 0.5 * (2e20 * 4.0026 + 1e20 * 15.9994) / 6.02257e26, 1e-18);
    EXPECT_NEAR(all.molar_mass, 1e-3 * (2.0 * 4.0026 + 15.9994) / 3.0, 1e-12);
    EXPECT_EQ(all.species.He, 1e20);
    EXPECT_EQ(all.temperature, 900.0);
    EXPECT_EQ(all.exosphere, 1000.0);
}

} // namespace jacchia_test
} // namespace fledge::world

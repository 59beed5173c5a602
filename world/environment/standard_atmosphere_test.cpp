// SPDX-License-Identifier: Apache-2.0
// Against the published tables of the standard, and against the laws that it is made of.
#include "world/environment/standard_atmosphere.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fledge::world {
namespace standard_atmosphere_test {

struct Point {
    double km, temperature, pressure, density;
};

TEST(StandardAtmosphere, HasThePublishedValues)
{
    // US Standard Atmosphere 1976, table I, geometric altitudes, as many digits as it has.
    const Point table[] = {
        {0, 288.15, 1.01325e5, 1.2250},       {5, 255.676, 5.4048e4, 7.3643e-1},    {11, 216.774, 2.2700e4, 3.6480e-1},
        {20, 216.65, 5.5293e3, 8.8910e-2},    {32, 228.490, 8.8906e2, 1.3555e-2},   {50, 270.65, 7.9779e1, 1.0269e-3},
        {70, 219.585, 5.2209, 8.2829e-5},     {80, 198.639, 1.0524, 1.8458e-5},     {86, 186.87, 3.7338e-1, 6.958e-6},
        {90, 186.87, 1.8359e-1, 3.416e-6},    {100, 195.08, 3.2011e-2, 5.604e-7},   {110, 240.00, 7.1042e-3, 9.708e-8},
        {120, 360.00, 2.5382e-3, 2.222e-8},   {150, 634.39, 4.5422e-4, 2.076e-9},   {200, 854.56, 8.4736e-5, 2.541e-10},
        {300, 976.01, 8.7704e-6, 1.916e-11},  {400, 995.83, 1.4518e-6, 2.803e-12},  {500, 999.24, 3.0236e-7, 5.215e-13},
        {600, 999.85, 8.2130e-8, 1.137e-13},  {700, 999.97, 3.1908e-8, 3.070e-14},  {800, 999.99, 1.7036e-8, 1.136e-14},
        {900, 1000.00, 1.0873e-8, 5.759e-15}, {1000, 1000.00, 7.5138e-9, 3.561e-15}};
    for (const Point &point : table) {
        const Air air = StandardAtmosphere::get().at(1e3 * point.km);
        EXPECT_NEAR(air.temperature, point.temperature, 0.006) << point.km;
        EXPECT_NEAR(air.pressure, point.pressure, (point.km < 86 ? 2e-4 : 2e-3) * point.pressure) << point.km;
        EXPECT_NEAR(air.density, point.density, (point.km < 86 ? 2e-4 : 1e-3) * point.density) << point.km;
    }
}

TEST(StandardAtmosphere, IsInHydrostaticEquilibrium)
{
    // dp/dZ = -density g, with the gravity of the standard. To 86 km by its definition; in the heights where each
    // species is on its own, from the sum of all.
    const auto worst = [](double from, double to, double step) {
        double largest = 0.0;
        for (double Z = from; Z < to; Z += step) {
            const double h = 1.0;
            const double slope =
                (StandardAtmosphere::get().at(Z + h).pressure - StandardAtmosphere::get().at(Z - h).pressure) / (2 * h);
            const double ratio = 6356766.0 / (6356766.0 + Z);
            const double weight = StandardAtmosphere::get().at(Z).density * 9.80665 * ratio * ratio;
            largest = std::max(largest, std::abs(slope / weight + 1.0));
        }
        return largest;
    };
    EXPECT_LT(worst(-4000.0, 85990.0, 97.0), 1e-6);
    EXPECT_LT(worst(200e3, 990e3, 997.0), 0.01);
}

TEST(StandardAtmosphere, FallsWithoutStepsAndWithoutEnd)
{
    const StandardAtmosphere &all = StandardAtmosphere::get();
    double last = all.at(-5000.0).density;
    for (double Z = -4990.0; Z < 1.2e6; Z += 10.0) {
        const double density = all.at(Z).density;
        ASSERT_LT(density, last) << Z;
        ASSERT_GT(density, last * 0.997) << Z;
        last = density;
    }
    EXPECT_EQ(all.at(-1e6).density, all.at(-5000.0).density);
    EXPECT_GT(all.at(1e7).density, 0.0);
    EXPECT_EQ(all.at(1e12).density, 0.0);
    EXPECT_EQ(all.at(HUGE_VAL).density, 0.0);
    EXPECT_EQ(all.at(std::nan("")).density, all.at(-5000.0).density);
}

} // namespace standard_atmosphere_test
} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/published_dtm2000.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fledge::world {
namespace dtm2000_test {

using namespace published_dtm2000;

TEST(DTM2000, HasThePublishedDensities)
{
    for (const Row &row : rows) {
        EXPECT_NEAR(of(row).density, row.density, 2e-13 * row.density) << row.km << ' ' << row.day;
    }
}

TEST(DTM2000, HasOrekitsDensities)
{
    for (const OrekitRow &row : orekit_rows) {
        EXPECT_NEAR(of(row).density, row.density, 1e-13 * row.density) << row.km;
    }
}

TEST(DTM2000, IsInDiffusiveEquilibrium)
{
    // Each species alone: d ln(n T^(1 + alpha)) / dz = -M g / (R T), all over the globe and in storms.
    const struct {
        double AirSpecies::*n;
        double M, alpha;
    } gases[] = {{&AirSpecies::H, 1, -0.4},
                 {&AirSpecies::He, 4, -0.38},
                 {&AirSpecies::O, 16, 0},
                 {&AirSpecies::N2, 28, 0},
                 {&AirSpecies::O2, 32, 0}};
    for (double km = 130.0; km < 1500.0; km *= 1.17) {
        const auto air = [&](double up) {
            return dtm2000(at(km + up, 1.3 * km / 30.0 - 30.0, 100, km), activity(120, 140, 5, 3));
        };
        const double h = 0.01, r = 1.0 + km / 6356.77;
        const AirComposition below = air(-h), here = air(0.0), above = air(h);
        for (const auto &gas : gases) {
            const double slope = (std::log(above.species.*gas.n / (below.species.*gas.n)) +
                                  (1.0 + gas.alpha) * std::log(above.temperature / below.temperature)) /
                                 (2e3 * h);
            EXPECT_NEAR(slope * 8314.0 * here.temperature / (gas.M * 9.80665 / (r * r)), -1.0, 1e-5)
                << km << ' ' << gas.M;
        }
    }
}

TEST(DTM2000, SumsItsSpecies)
{
    const AirComposition air = dtm2000(at(400.0, 10.0, 200), activity(150.0, 150.0, 2.0, 2.0));
    const AirSpecies &n = air.species;
    const double mass = (1.00 * n.H + 4.00 * n.He + 16.0 * n.O + 28.0 * n.N2 + 32.0 * n.O2) / 6.02214076e26;
    EXPECT_NEAR(air.density, mass, 2e-4 * mass); // its masses have four digits
    EXPECT_NEAR(air.molar_mass, 0.016, 0.002);   // atomic oxygen, most of it
    EXPECT_EQ(n.N, 0.0);
    EXPECT_EQ(n.Ar, 0.0);
    EXPECT_LT(air.temperature, air.exosphere);
}

TEST(DTM2000, IsPeriodic)
{
    const SolarActivity sun = activity(130.0, 120.0, 3.0, 2.0);
    AirPlace place = at(350.0, -35.0, 47, 77.0);
    const double density = dtm2000(place, sun).density;
    place.longitude += 2.0 * M_PI;
    EXPECT_NEAR(dtm2000(place, sun).density, density, 1e-12 * density);
    place.hour_angle -= 2.0 * M_PI;
    EXPECT_NEAR(dtm2000(place, sun).density, density, 1e-12 * density);
    place.day_of_year += 365; // of the law, which has no leap years; its season of 120 km is that of the winter in both
    EXPECT_NEAR(dtm2000(place, sun).density, density, 1e-6 * density);
    place.longitude += 0.3;
    EXPECT_GT(std::abs(dtm2000(place, sun).density / density - 1.0), 1e-3);
}

TEST(DTM2000, ChangesLittleFromDayToDay)
{
    // Where the seasons of 120 km begin and end, too.
    for (const double km : {120.0, 200.0, 600.0}) {
        double last = dtm2000(at(km, 60.0, 365), activity(150.0, 150.0)).density;
        for (int day = 1; day <= 365; day++) {
            const double density = dtm2000(at(km, 60.0, day), activity(150.0, 150.0)).density;
            ASSERT_NEAR(density, last, 0.02 * last) << km << ' ' << day;
            last = density;
        }
    }
}

TEST(DTM2000, IsTheSameOfThePolesFromAllLongitudes)
{
    // There only the local time remains, and none of its waves.
    for (const double pole : {-90.0, 90.0}) {
        const double density = dtm2000(at(300.0, pole, 80), activity(100.0, 150.0)).density;
        AirPlace place = at(300.0, pole, 80, 123.0);
        place.hour_angle = -2.0;
        EXPECT_NEAR(dtm2000(place, activity(100.0, 150.0)).density, density, 1e-9 * density);
    }
}

TEST(DTM2000, GrowsWithFluxAndStorms)
{
    const AirPlace place = at(500.0, 20.0, 80);
    const double quiet = dtm2000(place, activity(100.0, 100.0, 1.0, 1.0)).density;
    EXPECT_GT(dtm2000(place, activity(130.0, 100.0, 1.0, 1.0)).density, 1.05 * quiet);
    EXPECT_GT(dtm2000(place, activity(100.0, 130.0, 1.0, 1.0)).density, 1.2 * quiet);
    EXPECT_GT(dtm2000(place, activity(100.0, 100.0, 6.0, 1.0)).density, 1.2 * quiet);
    EXPECT_NE(dtm2000(place, activity(100.0, 100.0, 1.0, 4.0)).density, quiet);
    EXPECT_EQ(dtm2000(at(0.0, 20.0, 80), activity(100.0, 100.0)).density,
              dtm2000(at(120.0, 20.0, 80), activity(100.0, 100.0)).density);
}

} // namespace dtm2000_test
} // namespace fledge::world

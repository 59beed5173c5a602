// SPDX-License-Identifier: Apache-2.0
// Against outputs of the authors' program (published_jb2008.h).
#include "world/environment/air/published_jb2008.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fledge::world {
namespace jb2008_test {

using namespace published_jb2008;

template <int rows> void expect_rows(const Row (&table)[rows], AirComposition (*of_row)(const Row &))
{
    for (const Row &row : table) {
        const AirComposition air = of_row(row);
        // Half of the last digit, and what the four digits of the Sun's place leave open.
        EXPECT_NEAR(air.exosphere, row.exosphere, 0.055) << row.km;
        EXPECT_NEAR(air.temperature, row.temperature, 0.055) << row.km;
        EXPECT_NEAR(air.density, row.density, 8e-5 * row.density) << row.km;
    }
}

TEST(JB2008, HasThePublishedValues)
{
    expect_rows(rows_2017, of_2017);
    expect_rows(rows_2009, of_2009);
}

TEST(JB2008, GivesWhatTheAuthorsProgramGives)
{
    for (const Row &row : rows_2001) {
        const AirComposition air = of_2001(row);
        EXPECT_NEAR(air.exosphere, row.exosphere, 1e-4) << row.km;
        EXPECT_NEAR(air.temperature, row.temperature, 1e-4) << row.km;
        EXPECT_NEAR(air.density, row.density, 2e-6 * row.density) << row.km;
    }
}

TEST(JB2008, HasThePublishedDensitiesOfStorms)
{
    for (const Storm &row : storms) {
        EXPECT_NEAR(of(row).density, row.density, 2e-5 * row.density) << row.day;
    }

    // The place here by its right ascension.
    AirPlace place = at(91.0, 0.0, 0.0, 52951.003805740744, 312, 0.0, -0.285987757544287);
    place.hour_angle = 1.28211886851503 - 3.046653643566772;
    place.geocentric_latitude = -1.4877186543999;
    const SolarActivity sun = activity(91.0, 137.1, 108.8, 123.8, 116.7, 128.5, 168.0, 138.6, 43.0);
    EXPECT_NEAR(jb2008(place, sun).density, 0.27945654e-5, 2e-12);
}

TEST(JB2008, FallsAndJoins)
{
    const SolarActivity sun = activity(150.0, 140.0, 145.0, 140.0, 130.0, 140.0, 120.0, 130.0, 60.0);
    AirPlace place = at(90.0, 40.0, -35.0, 55123.4, 293, 3.6, -0.2);
    double last = jb2008(place, sun).density;
    for (double km = 90.01; km < 1999.0; km += 0.01 + 1e-4 * km) {
        place.altitude = 1e3 * km;
        const double density = jb2008(place, sun).density;
        ASSERT_LT(density, last) << km;
        ASSERT_GT(density, 0.98 * last) << km;
        last = density;
    }
    place.altitude = 0.0;
    const double below = jb2008(place, sun).density;
    place.altitude = 90e3;
    EXPECT_EQ(below, jb2008(place, sun).density);
}

} // namespace jb2008_test
} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
// Against the runs that NASA publishes with JEOD (published_met.h).
#include "world/environment/air/published_met.h"

#include "world/environment/air/jacchia.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fledge::world {
namespace met_test {

using namespace published_met;

template <int rows> void expect_rows(const Row (&table)[rows], AirComposition (*of_row)(const Row &), double exosphere)
{
    for (const Row &row : table) {
        const AirComposition air = of_row(row);
        EXPECT_NEAR(air.exosphere, exosphere, 1e-7 * exosphere);
        EXPECT_NEAR(air.temperature, row.temperature, 1e-7 * row.temperature) << row.km;
        // JEOD's weights of integration have 7 digits; up to 105 km it takes the density that the sum rounds.
        EXPECT_NEAR(air.density, row.density, (row.km < 105.0 ? 1e-5 : 3e-7) * row.density) << row.km;
    }
}

TEST(MET, HasThePublishedDensitiesAndTemperatures)
{
    expect_rows(cape_rows, at_cape, 1379.074105237556);
    expect_rows(north_rows, at_north, 1231.724662723262);
}

TEST(MET, HasThePublishedValuesOfAllLatitudes)
{
    for (const LatitudeRow &row : latitude_rows) {
        const AirComposition air = of(row);
        EXPECT_NEAR(air.temperature, row.temperature, 1e-7 * row.temperature) << row.latitude;
        EXPECT_NEAR(air.density, row.density, 3e-7 * row.density) << row.latitude;
    }
}

TEST(MET, HasThePublishedSpecies)
{
    const struct {
        double km;
        AirSpecies species; // He, O, N2, O2, Ar, H
    } table[] = {
        {150, {17030677509583.68, 1.710457620646976e16, 3.477688567239032e16, 4523878254126167.0, 97325671676129.27}},
        {400, {4777496281352.013, 215210767316364.1, 23429144945270.24, 1154126536031.834, 3579390722.311786}},
        {450, {4234283672817.626, 108988521004858.9, 7135945749288.819, 296958276854.1871, 657872824.0755343}},
        {500, {7256388361374.8, 55916251559669.77, 2220892243729.351, 78299513643.78349, 124615261.2176263}},
        {1000,
         {1558579820123.181, 119992172029.7776, 47351078.9756294, 361550.6766713494, 27.21433032310129,
          5411492165.409597}}};
    constexpr double AirSpecies::*all[] = {&AirSpecies::He, &AirSpecies::O,  &AirSpecies::N2,
                                           &AirSpecies::O2, &AirSpecies::Ar, &AirSpecies::H};
    AirPlace place = north;
    for (const auto &row : table) {
        place.altitude = 1e3 * row.km;
        const AirComposition air = met(place, activity());
        for (const auto n : all) {
            EXPECT_NEAR(air.species.*n, row.species.*n, 5e-7 * row.species.*n) << row.km;
        }
    }
    place.altitude = 400e3; // where the law changes no density after their sum
    EXPECT_NEAR(met(place, activity()).molar_mass, 16.99179096343797e-3, 1e-9);
}

TEST(MET, FollowsFluxAndStorms)
{
    // Jacchia 1970, equations 14 and 20. Between two places of one instant differs what is in proportion to the minimum
    // of the night.
    const auto exosphere = [](const AirPlace &place, double F107, double mean, double ap) {
        return met(place, activity(F107, mean, ap)).exosphere;
    };
    const auto spread = [&](double F107, double mean) {
        return exosphere(at(400.0, -60.0, 180.0, north.mjd), F107, mean, 4.0) - exosphere(north, F107, mean, 4.0);
    };
    const auto night = [](double F107, double mean) { return 383.0 + 3.32 * mean + 1.80 * (F107 - mean); };
    EXPECT_NEAR(spread(90.0, 100.0) / spread(230.0, 200.0), night(90.0, 100.0) / night(230.0, 200.0), 1e-9);
    EXPECT_NEAR(exosphere(north, 150.0, 150.0, 30.0) - exosphere(north, 150.0, 150.0, 0.0),
                30.0 + 100.0 * (1.0 - std::exp(-2.4)), 1e-9);
}

TEST(MET, MovesHeliumToTheWinter)
{
    // Jacchia 1971, equation 25, at the solstices.
    const struct {
        double mjd;
        int day;
        double latitude, logarithm;
    } table[] = {{55002.5, 172, 90.0, -0.35355},
                 {55002.5, 172, 30.0, 0.125 - 0.35355},

                 {55002.5, 172, -90.0, 1.0 - 0.35355},
                 {55185.5, 355, 90.0, 1.0 - 0.35355},
                 {55185.5, 355, -90.0, -0.35355}};
    for (const auto &row : table) {
        AirPlace place = at(700.0, row.latitude, 0.0, row.mjd);
        place.day_of_year = row.day;
        const AirComposition air = met(place, activity());
        const double uniform = JacchiaAir(air.exosphere).species(700.0, 2.1926e-5, 0.0093432).He;
        EXPECT_NEAR(std::log10(air.species.He / uniform), 0.65 * row.logarithm, 1e-3) << row.mjd << row.latitude;
    }
}

TEST(MET, IsInHydrostaticEquilibrium)
{
    // Between the seasons' changes below 170 km and above 440 km; helium has thermal diffusion, 1e-3 of all.
    AirPlace place = north;
    const auto air = [&](double km) {
        place.altitude = 1e3 * km;
        return met(place, activity());
    };
    const auto pressure = [&](double km) {
        const AirComposition here = air(km);
        return here.density / here.molar_mass * 8.31432 * here.temperature;
    };
    for (double km = 171.0; km < 439.0; km += 3.7) {
        const double h = 0.05, r = 1.0 + km / 6356.766;
        const double slope = (pressure(km + h) - pressure(km - h)) / (2e3 * h);
        EXPECT_NEAR(slope / (air(km).density * 9.80665 / (r * r)), -1.0, 1e-3) << km;
    }
}

TEST(MET, FallsAndJoins)
{
    AirPlace place = cape;
    place.altitude = 90e3;
    double last = met(place, activity()).density;
    for (double km = 90.01; km < 2500.0; km += 0.01 + 1e-4 * km) {
        place.altitude = 1e3 * km;
        const double density = met(place, activity()).density;
        ASSERT_LT(density, last) << km;
        ASSERT_GT(density, 0.98 * last) << km;
        last = density;
    }
    place.altitude = 0.0;
    const double below = met(place, activity()).density;
    place.altitude = 90e3;
    EXPECT_EQ(below, met(place, activity()).density);
}

} // namespace met_test
} // namespace fledge::world

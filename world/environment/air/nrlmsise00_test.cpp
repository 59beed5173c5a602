// SPDX-License-Identifier: Apache-2.0
// Against the values that NRL publishes with the model (published_nrlmsise00.h), against tables that NASA's CCMC
// computed with it, and against the laws that it follows.
#include "world/environment/air/published_nrlmsise00.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace fledge::world {
namespace nrlmsise00_test {

using namespace published_nrlmsise00;

/// As many digits as NRL prints.
std::string printed(double value)
{
    char text[32];
    std::snprintf(text, sizeof text, "%.6e", value);
    return text;
}

TEST(Nrlmsise00, HasAllDigitsOfThePublishedTestValues)
{
    for (const Published &row : published) {
        const AirComposition air = of(row);
        const AirSpecies &n = air.species;
        EXPECT_EQ(printed(1e-6 * n.He), printed(row.He));
        EXPECT_EQ(printed(1e-6 * n.O), printed(row.O));
        EXPECT_EQ(printed(1e-6 * n.N2), printed(row.N2));
        EXPECT_EQ(printed(1e-6 * n.O2), printed(row.O2));
        EXPECT_EQ(printed(1e-6 * n.Ar), printed(row.Ar));
        EXPECT_EQ(printed(1e-3 * plain_density(air)), printed(row.density));
        EXPECT_EQ(printed(1e-6 * n.H), printed(row.H));
        EXPECT_EQ(printed(1e-6 * n.N), printed(row.N));
        EXPECT_EQ(printed(1e-6 * n.anomalous_O), printed(row.anomalous_O));
        EXPECT_EQ(printed(air.exosphere), printed(row.exosphere));
        EXPECT_EQ(printed(air.temperature), printed(row.temperature));
    }
}

/// A row of a table: km; O, N2, O2 [1/cm^3]; g/cm^3 without anomalous oxygen; K there and of the exosphere; He, Ar, H,
/// N, anomalous oxygen [1/cm^3].
using Row = std::vector<double>;

void compare(const Row &row, const AirComposition &air, double tolerance, double kelvin)
{
    const AirSpecies &n = air.species;
    const double found[] = {n.O, n.N2, n.O2, 1e3 * plain_density(air), 0.0, 0.0, n.He, n.Ar, n.H, n.N, n.anomalous_O};
    for (std::size_t i = 0; i < 11; i++) {
        if (i != 4 && i != 5) {
            EXPECT_NEAR(1e-6 * found[i], row[i + 1], tolerance * row[i + 1] + 1e-9) << row[0] << " km, value " << i;
        }
    }
    EXPECT_NEAR(air.temperature, row[5], kelvin) << row[0];
    EXPECT_NEAR(air.exosphere, row[6], 0.51) << row[0];
}

TEST(Nrlmsise00, HasTheTableOfCcmcForADailyAp)
{
    // 1986-06-19 21:30 UT.
    const Row table[] = {
        {0, 0, 1.918e+19, 5.145e+18, 0.00118, 297.7, 1027, 1.287e+14, 2.294e+17, 0, 0, 0},
        {100, 4.244e+11, 9.498e+12, 2.24e+12, 5.783e-10, 165.9, 1027, 1.061e+08, 9.883e+10, 2.209e+07, 367000, 0},
        {200, 2.636e+09, 2.248e+09, 1.59e+08, 1.838e-13, 829.3, 909, 5.491e+06, 1.829e+06, 236500, 3.125e+07,
         1.802e-09},
        {300, 3.321e+08, 6.393e+07, 2.881e+06, 1.212e-14, 900.6, 909, 3.173e+06, 11560, 171700, 6.708e+06, 4.938},
        {400, 5.088e+07, 2.414e+06, 68380, 1.51e-15, 907.7, 909, 1.979e+06, 107.4, 151800, 1.274e+06, 1237},
        {500, 8.34e+06, 102000, 1839, 2.41e-16, 908.5, 909, 1.259e+06, 1.17, 135500, 260800, 4047},
        {600, 1.442e+06, 4729, 55, 4.543e-17, 908.6, 909, 811900, 0.01455, 121400, 56170, 4167},
        {700, 262200, 239.4, 1.817, 1.097e-17, 908.6, 909, 530100, 0.000205, 109200, 12640, 3173},
        {800, 49990, 13.17, 0.06608, 3.887e-18, 908.6, 909, 350300, 3.254e-06, 98430, 2964, 2246},
        {900, 9980, 0.7852, 0.002633, 1.984e-18, 908.6, 909, 234200, 5.794e-08, 89000, 723.7, 1571},
        {1000, 2082, 0.05055, 0.0001146, 1.244e-18, 908.6, 909, 158200, 1.151e-09, 80690, 183.6, 1103}};
    for (const Row &row : table) {
        compare(row,
                nrlmsise00(place_at(row[0], -16.0, 312.0, 170, 77400.0, 21.5 + 312.0 / 15.0 - 24.0),
                           activity_of(121.0, 80.0, 7.0)),
                5.1e-4, 0.051);
    }
}

TEST(Nrlmsise00, HasTheTableOfCcmcForAQuietDay)
{
    // 2016-06-01 11:00 UT, with the fluxes and the ap that the table states: rounded to 0.1, which in the mean flux is
    // 0.15 K. The table has a history of ap too, but not its effect.
    const Row table[] = {
        {0, 0, 1.919e+19, 5.149e+18, 0.001181, 296, 1027, 1.288e+14, 2.296e+17, 0, 0, 0},
        {100, 6.009e+11, 9.392e+12, 2.213e+12, 5.764e-10, 165.2, 1027, 1.339e+08, 9.58e+10, 2.654e+07, 273700, 0},
        {200, 3.882e+09, 1.978e+09, 1.341e+08, 2.028e-13, 687.5, 706, 2.048e+07, 971900, 517200, 1.632e+07, 1.399e-09},
        {300, 3.14e+08, 2.481e+07, 934000, 9.666e-15, 705.5, 706, 1.082e+07, 1879, 386000, 2.205e+06, 3.876},
        {400, 2.855e+07, 373700, 7743, 8.221e-16, 706, 706, 5.938e+06, 4.688, 331700, 263300, 973.8},
        {500, 2.787e+06, 6372, 73.82, 9.764e-17, 706, 706, 3.319e+06, 0.01397, 286800, 34240, 3186},
        {600, 291000, 122.2, 0.8047, 2.079e-17, 706, 706, 1.887e+06, 4.919e-05, 249000, 4742, 3281},
        {700, 32400, 2.622, 0.009973, 8.474e-18, 706, 706, 1.09e+06, 2.034e-07, 217100, 694.6, 2498},
        {800, 3835, 0.06264, 0.0001398, 4.665e-18, 706, 706, 639300, 9.809e-10, 190000, 107.4, 1768},
        {900, 481.6, 0.001659, 2.204e-06, 2.817e-18, 706, 706, 380600, 5.481e-12, 166900, 17.47, 1236},
        {1000, 64, 4.853e-05, 3.891e-08, 1.772e-18, 706, 706, 229800, 3.528e-14, 147100, 2.988, 867.5}};
    for (const Row &row : table) {
        compare(row, nrlmsise00(place_at(row[0], -23.0, -45.0, 153, 39600.0, 8.0), activity_of(89.0, 89.4, 4.9)), 5e-3,
                0.15);
    }
}

/// Places and activities all over the Earth, the year and the Sun's cycle.
template <class Check> void everywhere(double km, Check check)
{
    for (int i = 0; i < 200; i++) {
        const double longitude = std::remainder(137.0 * i, 360.0), seconds = std::fmod(12345.0 * i, 86400.0);
        const AirPlace place =
            place_at(km, -88.0 + 0.88 * i, longitude, 1 + 53 * i % 365, seconds, seconds / 3600.0 + longitude / 15.0);
        SolarActivity sun = activity_of(70.0 + 7 * i % 180, 75.0 + 11 * i % 150, 3 * i % 100);
        sun.history = i % 2 == 1;
        check(place, sun);
    }
}

TEST(Nrlmsise00, MassesOfTheSpeciesMakeTheDensityAndTheMeanMass)
{
    // By CODATA's unit of mass and IUPAC's weights; the model has whole ones.
    for (const double km : {0.0, 30.0, 60.0, 68.0, 90.0, 120.0, 200.0, 400.0, 600.0}) {
        everywhere(km, [&](const AirPlace &place, const SolarActivity &sun) {
            const AirComposition air = nrlmsise00(place, sun);
            const AirSpecies &n = air.species;
            const double number = n.He + n.O + n.N2 + n.O2 + n.Ar + n.H + n.N + n.anomalous_O;
            const double mass = 1.66053907e-27 * (4.0026 * n.He + 15.999 * (n.O + n.anomalous_O) + 28.0134 * n.N2 +
                                                  31.998 * n.O2 + 39.948 * n.Ar + 1.008 * n.H + 14.007 * n.N);
            EXPECT_NEAR(air.density / mass, 1.0, 1e-3) << km;
            EXPECT_NEAR(air.molar_mass * number / (6.02214076e23 * mass), 1.0, 1e-3) << km;
        });
    }
}

TEST(Nrlmsise00, IsInHydrostaticEquilibrium)
{
    // dp/dz = -density g where the air is mixed, and where each species is on its own at the same temperature; p by
    // Boltzmann's constant, g by Somigliana's formula and the square of the distance.
    for (const double km : {2.0, 11.0, 25.0, 45.0, 60.0, 600.0, 800.0, 1000.0}) {
        everywhere(km, [&](AirPlace place, const SolarActivity &sun) {
            const auto pressure = [&](double altitude) {
                place.altitude = altitude;
                const AirComposition air = nrlmsise00(place, sun);
                const AirSpecies &n = air.species;
                return 1.380649e-23 * air.temperature * (n.He + n.O + n.N2 + n.O2 + n.Ar + n.H + n.N);
            };
            const double step = 10.0, slope = (pressure(1e3 * km + step) - pressure(1e3 * km - step)) / (2.0 * step);
            place.altitude = 1e3 * km;
            const double sine2 = std::sin(place.latitude) * std::sin(place.latitude);
            const double surface =
                9.7803253359 * (1.0 + 0.00193185265241 * sine2) / std::sqrt(1.0 - 0.00669437999013 * sine2);
            const double fall = 6371.0 / (6371.0 + km);
            const double weight = plain_density(nrlmsise00(place, sun)) * surface * fall * fall;
            EXPECT_NEAR(slope / weight, -1.0, km < 62.5 ? 1.5e-3 : 4e-3) << km;
        });
    }
}

TEST(Nrlmsise00, JumpsOnlyWhereTheModelDoes)
{
    // On both sides of where a formula ends: small steps where the temperature's variations or a species' mixing end,
    // as the model is made; none elsewhere.
    for (const double km : {0.001, 32.5, 62.5, 72.5, 123.435, 160.0, 200.0, 250.0, 300.0, 320.0, 450.0, 700.0}) {
        const bool formula_ends =
            km == 72.5 || km == 123.435 || km == 160.0 || km == 300.0 || km == 450.0 || km == 250.0;
        everywhere(km, [&](AirPlace place, const SolarActivity &sun) {
            place.altitude = 1e3 * km - 1e-3;
            const AirComposition below = nrlmsise00(place, sun);
            place.altitude = 1e3 * km + 1e-3;
            const AirComposition above = nrlmsise00(place, sun);
            EXPECT_NEAR(above.density / below.density, 1.0, formula_ends ? 0.012 : 1e-6) << km;
            EXPECT_NEAR(above.temperature, below.temperature, km == 123.435 ? 4.0 : 1e-4) << km;
        });
    }
}

TEST(Nrlmsise00, FallsWithoutEndAndStopsAtTheGround)
{
    AirPlace place = place_at(0.0, 30.0, 10.0, 100, 40000.0, 12.0);
    const SolarActivity sun = activity_of(150.0, 150.0, 4.0);
    double last = nrlmsise00(place, sun).density;
    place.altitude = -300.0;
    EXPECT_EQ(nrlmsise00(place, sun).density, last);
    for (double km = 1.0; km < 3000.0; km += 1.0) {
        place.altitude = 1e3 * km;
        const double density = nrlmsise00(place, sun).density;
        EXPECT_LT(density, last) << km;
        EXPECT_GT(density, 0.0) << km;
        last = density;
    }
    place.altitude = std::nan("");
    EXPECT_TRUE(std::isnan(nrlmsise00(place, sun).density));
}

TEST(Nrlmsise00, HasAnAnswerInTheGreatestStorms)
{
    for (const double km : {80.0, 90.0, 95.0, 100.0, 105.0, 110.0, 115.0, 118.0, 120.0, 123.0, 150.0, 300.0}) {
        everywhere(km, [&](const AirPlace &place, SolarActivity sun) {
            sun.ap.fill(400.0);
            const AirComposition air = nrlmsise00(place, sun);
            EXPECT_GT(air.density, 0.0) << km;
            EXPECT_LT(air.density, 1e-4) << km;
            EXPECT_GT(air.temperature, 0.0) << km;
        });
    }
}

TEST(Nrlmsise00, IsTheSameAfterATurnOfLongitudeAndHour)
{
    // But for the model's rounding of pi.
    everywhere(400.0, [](AirPlace place, const SolarActivity &sun) {
        const double density = nrlmsise00(place, sun).density;
        place.longitude += 2.0 * M_PI;
        place.hour_angle += 2.0 * M_PI;
        EXPECT_NEAR(nrlmsise00(place, sun).density / density, 1.0, 2e-5);
    });
}

TEST(Nrlmsise00, AConstantHistoryIsNearlyTheDaysMean)
{
    // The two ways were fitted apart; a storm an hour ago counts, the same storm two days ago hardly.
    const AirPlace place = place_at(400.0, 60.0, -70.0, 172, 29000.0, 16.0);
    SolarActivity sun = activity_of(150.0, 150.0, 30.0);
    sun.ap.fill(30.0);
    const double daily = nrlmsise00(place, sun).density;
    sun.history = true;
    EXPECT_NEAR(nrlmsise00(place, sun).density / daily, 1.0, 0.05);
    sun.ap.fill(4.0);
    const double quiet = nrlmsise00(place, sun).exosphere;
    double last = 0.0;
    for (const std::size_t i : {6u, 4u, 3u, 2u, 1u}) {
        sun.ap.fill(4.0);
        sun.ap[i] = 200.0;
        const double hotter = nrlmsise00(place, sun).exosphere - quiet;
        EXPECT_GT(hotter, last) << i;
        last = hotter;
    }
}

} // namespace nrlmsise00_test
} // namespace fledge::world

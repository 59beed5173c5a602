// SPDX-License-Identifier: Apache-2.0
// Against JPL's DE405, published examples, gravity, and derivatives.
#include "flight/navigation/testing/sky_theory.h"

extern "C" {
#include "flight/navigation/earth_orientation.h"
#include "flight/navigation/sun_on_board.h"
}

namespace flight::testing {
namespace sun_on_board_test {

BodyState at(double days)
{
    SunOnBoard m{};
    m.in.time = utc(days);
    sun_on_board_update(&m, {0, 0});
    return m.out.sun;
}

TEST(SunOnBoard, is_where_DE405_has_it)
{
    // Relative to the Earth, ICRF axes, from 2001 to 2049.
    const std::vector<SkyRow> rows = {
        {402.25, {109666555352, -90549999303, -39257916884}, {20400.8, 20410.5, 8850.3}},
        {1733.5, {-148649328059, -17015448807, -7376812699}, {4168.7, -27009.2, -11708.4}},
        {2961.75, {114323554191, -85668197733, -37139858025}, {19329.8, 21281.2, 9227.1}},
        {4100, {148878877283, 7982308595, 3459895359}, {-1242.6, 27382.7, 11872.1}},
        {5320.125, {-83539428909, 116438565433, 50477575631}, {-24408.3, -14930.3, -6472.3}},
        {6200.5, {3472051224, -134971922223, -58511115372}, {30269.9, 737.2, 320.2}},
        {7777.25, {133036956447, 63960089047, 27726214246}, {-13351.6, 24311.2, 10540.0}},
        {9652.5, {39384179312, 134494899400, 58300718325}, {-28277.7, 7201.1, 3122.8}},
        {10500.75, {-148228174523, -19579889819, -8486035558}, {4732.9, -26941.2, -11677.7}},
        {12000.25, {-102139574222, -98517750040, -42702907544}, {22079.6, -18729.7, -8118.8}},
        {15000.5, {86212689193, -109575404732, -47495616042}, {24645.6, 16093.4, 6974.1}},
        {18200.75, {-117743526530, -83081715703, -36007553160}, {18655.0, -21561.8, -9344.5}}};
    expect_rows(at, rows, 0.0025, 3e6, 3.0);
}

TEST(SunOnBoard, is_that_of_the_example_of_meeus)
{
    // 1992-10-13 TT, chapter 25, by VSOP87: longitude of the mean equinox of date and distance.
    const double days = 2448908.5 - 2451545.0 - EARTH_TT_UTC / 86400, T = earth_centuries(days);
    const Vector3d r = turn(0, earth_obliquity(T)) * eigen(earth_precession(T)) * eigen(at(days).r_PN_N);
    EXPECT_NEAR(std::atan2(r.y(), r.x()) * 180 / pi, 199.907372 - 360, 0.0025);
    EXPECT_NEAR(r.norm() / 149597870700.0, 0.99760775, 2e-5);
}

TEST(SunOnBoard, velocity_and_acceleration_are_the_derivatives)
{
    expect_derivatives(at, 1e-6, 1e-4);
}

TEST(SunOnBoard, falls_as_gravity_says)
{
    // The Earth falls towards the Sun, and a hundredth as much towards the Moon.
    for (int i = 0; i < 400; i++) {
        const BodyState sun = at(45.0 * i);
        const Vector3d r = eigen(sun.r_PN_N), gravity = -1.32712440e20 / std::pow(r.norm(), 3) * r;
        EXPECT_LT((eigen(sun.a_PN_N) - gravity).norm(), 0.01 * gravity.norm()) << i;
    }
}

TEST(SunOnBoard, says_what_it_does_not_know)
{
    expect_honest<SunOnBoard>(sun_on_board_update, sun_on_board_reset,
                              [](auto &m) -> BodyState & { return m.out.sun; });
}

} // namespace sun_on_board_test
} // namespace flight::testing

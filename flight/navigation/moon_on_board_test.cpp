// SPDX-License-Identifier: Apache-2.0
// Against JPL's DE405, published examples, gravity, and derivatives.
#include "flight/navigation/testing/sky_theory.h"

extern "C" {
#include "flight/navigation/earth_orientation.h"
#include "flight/navigation/moon_on_board.h"
}

namespace flight::testing {
namespace moon_on_board_test {

BodyState at(double days)
{
    MoonOnBoard m{};
    m.in.time = utc(days);
    moon_on_board_update(&m, {0, 0});
    return m.out.moon;
}

TEST(MoonOnBoard, is_where_DE405_has_it)
{
    // Relative to the Earth, ICRF axes, from 2001 to 2049.
    const std::vector<SkyRow> rows = {{402.25, {-156923695, 292967819, 133672282}, {-970.6, -501.6, -111.1}},
                                      {1733.5, {350938969, 151064750, 60612247}, {-379.7, 828.6, 459.1}},
                                      {2961.75, {373429380, -8993348, 16103293}, {-22.8, 930.6, 491.4}},
                                      {4100, {-136208002, -315943044, -148412407}, {942.4, -444.0, -100.1}},
                                      {5320.125, {-201140775, 335687905, 107267765}, {-850.3, -437.8, -179.3}},
                                      {6200.5, {-371489587, -152001450, -37479610}, {348.2, -853.2, -304.1}},
                                      {7777.25, {7022278, 364153803, 170018815}, {-971.0, -50.2, 68.4}},
                                      {9652.5, {290105509, -245269449, -116637044}, {639.3, 651.4, 374.4}},
                                      {10500.75, {384528474, -128126113, -24999826}, {307.0, 822.4, 413.6}},
                                      {12000.25, {151776541, -326951930, -104394181}, {941.6, 412.3, 186.5}},
                                      {15000.5, {-283965021, -240443900, -98866839}, {732.6, -606.3, -360.0}},
                                      {18200.75, {36445768, -346832838, -128461012}, {1046.0, 81.3, 119.5}}};
    expect_rows(at, rows, 0.035, 8e4, 1.1);
}

TEST(MoonOnBoard, is_that_of_the_example_of_meeus)
{
    // 1992-04-12 TT, chapter 47, before nutation: longitude, latitude [deg], distance [m].
    const double days = 2448724.5 - 2451545.0 - EARTH_TT_UTC / 86400, T = earth_centuries(days);
    const Vector3d r = turn(0, earth_obliquity(T)) * eigen(earth_precession(T)) * eigen(at(days).r_PN_N);
    EXPECT_NEAR(std::atan2(r.y(), r.x()) * 180 / pi, 133.162655, 0.03);
    EXPECT_NEAR(std::asin(r.z() / r.norm()) * 180 / pi, -3.229126, 0.01);
    EXPECT_NEAR(r.norm(), 368409684.8, 8e4);
}

TEST(MoonOnBoard, velocity_and_acceleration_are_the_derivatives)
{
    expect_derivatives(at, 1e-6, 1e-4);
}

TEST(MoonOnBoard, falls_as_gravity_says)
{
    // Towards the Earth, which falls towards it, and as the Sun pulls it more than the Earth.
    const double mu = 3.986004e14 + 4.9028e12, sun = 1.32712440e20 / std::pow(1.471e11, 3);
    for (int i = 0; i < 400; i++) {
        const BodyState moon = at(45.3 * i);
        const Vector3d r = eigen(moon.r_PN_N), gravity = -mu / std::pow(r.norm(), 3) * r;
        EXPECT_LT((eigen(moon.a_PN_N) - gravity).norm(), 2.1 * sun * r.norm() + 2e-3 * gravity.norm()) << i;
    }
}

TEST(MoonOnBoard, says_what_it_does_not_know)
{
    expect_honest<MoonOnBoard>(moon_on_board_update, moon_on_board_reset,
                               [](auto &m) -> BodyState & { return m.out.moon; });
}

} // namespace moon_on_board_test
} // namespace flight::testing

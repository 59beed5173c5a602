// SPDX-License-Identifier: Apache-2.0
// Against published examples, the Earth as the IERS measured it, and derivatives.
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/earth_on_board.h"
#include "flight/navigation/earth_orientation.h"
}

namespace flight::testing {
namespace earth_on_board_test {

constexpr double arcsec = pi / 648000;

EarthOnBoard at(double days)
{
    EarthOnBoard m{};
    m.in.time = {good(), std::llround(days * 86400e9)};
    earth_on_board_update(&m, {5, 0});
    return m;
}

/// Of the turn between two attitudes [arcsec].
double angle(const Matrix3d &a, const Matrix3d &b)
{
    return (a - b).norm() / std::sqrt(2.0) / arcsec;
}

TEST(EarthOnBoard, nutation_and_obliquity_are_those_of_the_example_of_meeus)
{
    const double T = -0.127296372348; // 1987-04-10 TT, chapter 22
    double dpsi, deps;
    earth_nutation(T, &dpsi, &deps);
    EXPECT_NEAR(dpsi / arcsec, -3.788, 0.03);
    EXPECT_NEAR(deps / arcsec, 9.443, 0.03);
    EXPECT_NEAR(earth_obliquity(T) / arcsec, 23 * 3600 + 26 * 60 + 27.407, 1e-3);
}

TEST(EarthOnBoard, sidereal_time_is_that_of_the_examples_of_meeus_and_vallado)
{
    const auto seconds = [](double days) { return std::remainder(earth_sidereal_time(days), 2 * pi) / pi * 43200; };
    EXPECT_NEAR(seconds(2446895.5 - 2451545.0), 13 * 3600 + 10 * 60 + 46.3668 - 86400, 1e-4); // chapter 12
    const double hours = 12 + 14.0 / 60;
    EXPECT_NEAR(seconds(2448854.5 - 2451545.0 + hours / 24), 152.578787810 * 240, 1e-4); // example 3-5
}

TEST(EarthOnBoard, a_place_goes_from_J2000_to_TEME_and_to_the_earth_as_in_vallados_example)
{
    // 2004-04-06T07:51:28.386009 UTC, example 3-15, with the theories of 1976 to 1982.
    const double days = 2453101.5 - 2451545.0 + (7 * 3600 + 51 * 60 + 28.386009) / 86400, dut1 = -0.4399619;
    const Vector3d J2000(5102509.6, 6123011.52, 6378136.3), TEME(5094180.1072, 6127644.7052, 6380344.5327);
    const Vector3d fixed(-1033475.0313, 7901305.5856, 6380344.5327); // without polar motion
    EXPECT_LT((eigen(earth_teme(days)) * J2000 - TEME).norm(), 0.04 * arcsec * J2000.norm());
    EXPECT_LT((eigen(earth_dcm_PN_ut1(days, dut1)) * J2000 - fixed).norm(), 0.04 * arcsec * J2000.norm());
}

TEST(EarthOnBoard, is_within_an_arcsecond_of_the_earth_as_it_was_measured)
{
    // IAU 2006/2000A by ERFA with polar motion, UT1 - UTC and pole offsets of EOP 14 C04, at 0h UTC.
    const struct {
        double days, dut1;
        Mat3 dcm_PN;
    } measured[] = {{427.5,
                     0.0521985,
                     {{{-0.9500270383, 0.3121676152, 0.0000807135},
                       {-0.3121676149, -0.9500270417, 0.0000164445},
                       {0.0000818134, -0.0000095734, 0.9999999966}}}},
                    {3515.5,
                     0.2277038,
                     {{{0.8229532772, -0.5681085214, -0.0007819591},
                       {0.5681082376, 0.8229536483, -0.0005683397},
                       {0.0009663947, 0.0000234796, 0.9999995328}}}},
                    {5639.5,
                     -0.6645587,
                     {{{-0.1939201928, -0.9810172780, 0.0002432399},
                       {0.9810161535, -0.1939203390, -0.0014861815},
                       {0.0015051389, -0.0000495783, 0.9999988660}}}},
                    {7611.5,
                     -0.1755506,
                     {{{0.7378908821, 0.6749184326, -0.0014681285},
                       {-0.6749171039, 0.7378923427, 0.0013392373},
                       {0.0019871967, 0.0000026540, 0.9999980255}}}}};
    for (const auto &row : measured) {
        EarthOnBoard m = at(row.days);
        EXPECT_NEAR(angle(eigen(m.out.earth.dcm_PN), eigen(row.dcm_PN)), 15.041 * std::fabs(row.dut1), 1.0);
        m.par.dut1 = row.dut1;
        earth_on_board_update(&m, {6, 1});
        EXPECT_LT(angle(eigen(m.out.earth.dcm_PN), eigen(row.dcm_PN)), 0.8);
        EXPECT_EQ(m.out.earth.head.quality, QUALITY_GOOD);
    }
}

TEST(EarthOnBoard, the_rate_is_that_of_the_matrix)
{
    Random random{1};
    for (int i = 0; i < 200; i++) {
        const double days = random.real(0, 18000);
        const EarthOnBoard m = at(days);
        const Matrix3d dcm = eigen(m.out.earth.dcm_PN);
        EXPECT_LT((dcm * dcm.transpose() - Matrix3d::Identity()).norm(), 1e-14);
        EXPECT_NEAR(dcm.determinant(), 1.0, 1e-14);
        const auto later = [&](double t) -> Matrix3d { return eigen(earth_dcm_PN(days + t / 86400)); };
        const Matrix3d rate = derivative<Matrix3d, 2>(later, 100.0);
        // What is left out of it: precession and nutation turn the pole by 1e-11 rad/s.
        EXPECT_LT((rate + dcm * skew(eigen(m.out.earth.omega_PN_N))).norm(), 4e-11);
    }
    // Once a sidereal day, 23 h 56 min 4.0989 s of the stars.
    EXPECT_NEAR(2 * pi / EARTH_RATE, 86164.0989, 1e-4);
}

TEST(EarthOnBoard, says_what_it_does_not_know)
{
    EXPECT_EQ(at(-0.6).out.earth.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(at(18262.6).out.earth.head.quality, QUALITY_DEGRADED);
    EarthOnBoard m = at(9000.0);
    EXPECT_EQ(m.out.earth.head.t, 5);
    EXPECT_EQ(m.out.earth.head.sequence, 1U);
    expect_held(
        m, doubles(m.par),
        [](EarthOnBoard &module) {
            earth_on_board_update(&module, {9, 4});
        },
        [](EarthOnBoard &module) {
            return std::vector{&module.out.earth.head, &module.out.centre.head};
        });
    m.in.time.head.quality = QUALITY_STALE;
    earth_on_board_update(&m, {9, 4});
    EXPECT_EQ(m.out.earth.head.quality, QUALITY_DEGRADED);
    m.in.time.head.quality = QUALITY_NONE;
    earth_on_board_update(&m, {10, 1});
    EXPECT_EQ(m.out.earth.head.sequence, 2U);
    earth_on_board_reset(&m);
    EXPECT_TRUE(all_zero(m.out));
    earth_on_board_update(&m, {11, 1});
    EXPECT_TRUE(all_zero(m.out));
    for (const std::int64_t time : {INT64_MIN, INT64_MAX, std::int64_t{0}}) {
        m.in.time = {good(), time};
        earth_on_board_update(&m, {12, 1});
        EXPECT_TRUE(eigen(m.out.earth.dcm_PN).allFinite());
    }
}

} // namespace earth_on_board_test
} // namespace flight::testing

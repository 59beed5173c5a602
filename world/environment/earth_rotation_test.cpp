// SPDX-License-Identifier: Apache-2.0
// The Earth's orientation: against the theories by another way through ERFA, by what must hold for any, and what is
// refused. sky_test.py compares with the real series.
#include "world/environment/earth_rotation.h"

#include "sim/error.h"
#include "world/environment/testing/files.h"

#include <Eigen/Geometry>
#include <erfa.h>

#include <cstdio>
#include <random>

namespace fledge::world {
namespace earth_rotation_test {

using ::testing::HasSubstr;
using testing::TemporaryFile;
using Theory = EarthData::Theory;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double arcsecond = 4.84813681109536e-6;
constexpr std::int64_t hour = 3'600'000'000'000, day = 24 * hour;

const TimeSystem times;

EarthData numbers(Theory theory, double ut1_tai, double x = 0.0, double y = 0.0)
{
    return {theory, {}, ut1_tai, Eigen::Vector2d(x, y)};
}

Matrix3d matrix(const double (&m)[3][3])
{
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&m[0][0]);
}

/// By the equinox: sidereal time instead of the Earth rotation angle, and the matrix of precession and nutation.
Matrix3d by_the_equinox(Theory theory, Epoch epoch, double ut1_tai, double x, double y)
{
    const double tt = static_cast<double>(times.tt(epoch)) / 86'400e9;
    const std::int64_t tai = times.tai(epoch);
    const double ut1 = (static_cast<double>(tai % day) / 1e9 + ut1_tai) / 86'400.0; // of its day
    const double jd = 2'451'545.0, jd_ut1 = jd + static_cast<double>(tai / day);
    double m[3][3], pole[3][3], rotated[3][3];
    if (theory == Theory::iau2006) {
        eraPnm06a(jd, tt, m);
        eraRz(eraGst06a(jd_ut1, ut1, jd, tt), m);
        eraPom00(x, y, eraSp00(jd, tt), pole);
    } else {
        eraPnm80(jd, tt, m);
        eraRz(eraGmst82(jd_ut1, ut1) + eraEqeq94(jd, tt), m);
        eraPom00(x, y, 0.0, pole);
    }
    eraRxr(pole, m, rotated);
    return matrix(rotated);
}

TEST(EarthRotation, is_that_of_the_theories_by_way_of_the_equinox)
{
    std::mt19937_64 random(1);
    for (const Theory theory : {Theory::iau2006, Theory::iau1980}) {
        const double x = 0.2 * arcsecond, y = -0.3 * arcsecond;
        const EarthRotation earth(numbers(theory, -34.1, x, y), times);
        EarthRotation::Window window;
        for (int i = 0; i < 60; i++) {
            // 1970 to 2030
            const Epoch epoch{std::uniform_int_distribution<std::int64_t>(-10'950 * day, 10'950 * day)(random)};
            const Matrix3d expected = by_the_equinox(theory, epoch, -34.1, x, y);
            // 2 um at 400 km
            EXPECT_LT((earth.dcm_PN(epoch, 0.0, window) - expected).norm(), 3e-13) << epoch.ns;
        }
    }
}

TEST(EarthRotation, agrees_with_the_published_matrix_of_another_tool)
{
    // The check cases of NASA, at 0 s. Its sidereal time is without the terms of 1994, 6e-9 rad.
    const EarthRotation earth(numbers(Theory::iau1980, -32.469), times);
    EarthRotation::Window window;
    const Matrix3d found = earth.dcm_PN(times.epoch("2007-11-20T00:00:32 TAI"), 0.0, window);
    Matrix3d published;
    published << 0.5220631475846322, 0.8529067224982529, -0.0004389206242509629, -0.8529064801634415,
        0.5220633307031007, 0.0006440732829556199, 0.0007784787958251097, 3.811131932611407e-05, 0.9999996962590998;
    EXPECT_LT((found.row(2) - published.row(2)).norm(), 1e-13);
    EXPECT_LT((found - published).norm(), 1e-8);
}

TEST(EarthRotation, turns_at_the_rate_that_it_says)
{
    for (const Theory theory : {Theory::iau2006, Theory::iau1980}) {
        const EarthRotation earth(numbers(theory, -34.1, 0.3 * arcsecond, 0.2 * arcsecond), times);
        EarthRotation::Window window;
        for (const std::int64_t ns : {-20'000 * hour, 7 * hour, 150'000 * hour + 12'345}) {
            const Matrix3d behind = earth.dcm_PN({ns}, -50.0, window), ahead = earth.dcm_PN({ns}, 50.0, window);
            const BodyAttitude at = earth.at({ns}, 0.0, window);
            EXPECT_LT((at.dcm_PN - earth.dcm_PN({ns}, 0.0, window)).norm(), 1e-16);
            const Eigen::AngleAxisd turn(ahead * behind.transpose());
            // [PN] turns opposite to P.
            EXPECT_LT((-turn.angle() / 100.0 * turn.axis() - at.omega_PN_P).norm(), 1e-15);
            EXPECT_NEAR(at.omega_PN_P.norm(), 7.2921151e-5, 1e-11);
        }
    }
}

TEST(EarthRotation, does_not_depend_on_earlier_calls_and_does_not_jump)
{
    const EarthRotation earth(numbers(Theory::iau2006, -34.1), times);
    EarthRotation::Window window;
    Matrix3d last = earth.dcm_PN({-day}, 0.0, window);
    for (std::int64_t ns = -day; ns < day; ns += hour / 2 + 7) {
        EarthRotation::Window fresh;
        const Matrix3d found = earth.dcm_PN({ns}, 0.0, window);
        EXPECT_EQ(found, earth.dcm_PN({ns}, 0.0, fresh));
        earth.dcm_PN({ns - 10 * hour}, 0.0, window); // away, and back again
        EXPECT_EQ(found, earth.dcm_PN({ns}, 0.0, window));
    }
    // Over the border of an interval, where another polynomial begins.
    for (const std::int64_t border : {-6 * hour, 0 * hour, 6 * hour}) {
        const Matrix3d step = earth.dcm_PN({border}, -1e-6, window) - earth.dcm_PN({border}, 0.0, window);
        EXPECT_LT(step.norm(), 1.1e-10); // 7.3e-11 for each of two axes, in a microsecond
    }
    last = earth.dcm_PN({6 * hour - 1000}, 0.0, window);
    EXPECT_LT((last - earth.dcm_PN({6 * hour - 1000}, 0.0, window)).norm(), 1e-18);
}

// --- the file of the IERS --------------------------------------------------------------------------

/// Days from MJD 57200 (2015-06-27), with a leap second after the fourth; values linear in time.
std::string series(bool newer = false)
{
    std::string text = "   EOP C04, for a test\n\n      Date      MJD      x          y\n";
    const int days[] = {27, 28, 29, 30, 1, 2, 3, 4};
    for (int i = 0; i < 8; i++) {
        char line[160];
        const double x = 0.1 + 0.002 * i, y = 0.4 - 0.001 * i, ut1 = -0.67 - 0.0016 * i + (i > 3), dX = 1e-4 * i;
        if (newer) {
            std::snprintf(line, sizeof line, "2015  %d  %2d   0  %.2f  %.6f  %.6f  %.7f  %.6f  %.6f  0 0 0.0016\n",
                          i > 3 ? 7 : 6, days[i], 57200.0 + i, x, y, ut1, dX, -dX);
        } else {
            std::snprintf(line, sizeof line, "2015  %2d  %2d  %d  %.6f  %.6f  %.7f  0.0016  %.6f  %.6f  0 0 0 0 0 0\n",
                          i > 3 ? 7 : 6, days[i], 57200 + i, x, y, ut1, dX, -dX);
        }
        text += line;
    }
    return text;
}

EarthData of(const TemporaryFile &file)
{
    return {Theory::iau2006, file.path(), {}, {}};
}

TEST(EarthRotation, interpolates_the_series_across_a_leap_second)
{
    for (const bool newer : {false, true}) {
        const TemporaryFile file("eop.txt", series(newer));
        const EarthRotation earth(of(file), times);
        const Epoch begin = times.epoch("2015-06-27");
        for (const double days : {0.0, 0.3, 2.5, 3.9999, 4.2, 6.9}) {
            const auto found = earth.measured({begin.ns + static_cast<std::int64_t>(days * 86'400e9)});
            // UT1-TAI grows by 1.6 ms less a day, which is 86401 s long before the leap second.
            EXPECT_NEAR(found.ut1_tai, -35.67 - 0.0016 * days, 3e-8) << days;
            EXPECT_NEAR(found.x / arcsecond, 0.1 + 0.002 * days, 3e-8);
            EXPECT_NEAR(found.y / arcsecond, 0.4 - 0.001 * days, 3e-8);
            EXPECT_NEAR(found.dX / arcsecond, 1e-4 * days, 3e-9);
            EXPECT_NEAR(found.dY / arcsecond, -1e-4 * days, 3e-9);
        }
        EXPECT_EQ(error_of([&] { earth.require(begin, times.epoch("2015-07-04")); }), "");
        EXPECT_THAT(error_of([&] { earth.require(begin, times.epoch("2015-07-04T00:00:01")); }),
                    HasSubstr("eop.txt: the Earth's orientation is given from 2015-06-27T00:00:00Z to "
                              "2015-07-04T00:00:00Z; asked for at 2015-07-04T00:00:01Z"));
        EXPECT_THAT(error_of([&] { earth.require(times.epoch("2015-06-26T23:59:59"), begin); }),
                    HasSubstr("asked for at 2015-06-26T23:59:59Z"));
    }
}

TEST(EarthRotation, takes_numbers_in_place_of_those_of_the_series)
{
    const TemporaryFile file("eop.txt", series());
    EarthData data = of(file);
    data.ut1_tai = -36.0;
    data.pole = Eigen::Vector2d(1e-6, 2e-6);
    const auto found = EarthRotation(data, times).measured(times.epoch("2015-06-30"));
    EXPECT_EQ(found.ut1_tai, -36.0);
    EXPECT_EQ(found.x, 1e-6);
    EXPECT_EQ(found.y, 2e-6);
    EXPECT_NEAR(found.dX / arcsecond, 3e-4, 1e-12);
}

TEST(EarthRotation, refuses_a_damaged_series_with_its_line)
{
    const auto error = [](const std::string &from, const std::string &to) {
        std::string text = series();
        text.replace(text.find(from), from.size(), to);
        const TemporaryFile file("eop.txt", text);
        return error_of([&] { EarthRotation(of(file), times); });
    };
    EXPECT_EQ(error("-0.6716000", "-0.6716000"), "");
    EXPECT_THAT(error("-0.6716000", "-0.67x6000"), HasSubstr("eop.txt:5: expected a day of EOP C04: numbers only; "
                                                             "found \"-0.67x6000\""));
    EXPECT_THAT(error("-0.6716000", "-1.6716000"), HasSubstr("eop.txt:5: UT1-UTC [s] is -1.6716; expected at most 1"));
    EXPECT_THAT(error("-0.6716000", "-0.6916000"), HasSubstr("eop.txt:5: the change of UT1-TAI in a day"));
    EXPECT_THAT(error("57202", "57203"), HasSubstr("eop.txt:6: expected the day after MJD 57201; found MJD 57203"));
    EXPECT_THAT(error("6  29", "6  28"), HasSubstr("eop.txt:6: the date is not that of MJD 57202"));
    EXPECT_THAT(error("0.102000", "3.102000"), HasSubstr("eop.txt:5: x [arcsec] is 3.102; expected at most 2"));
    EXPECT_THAT(error("0.102000", "0.302000"), HasSubstr("eop.txt:5: the change of x in a day [arcsec] is 0.2"));
    EXPECT_THAT(error("0.0016  0.000200", "0.0016"), HasSubstr("eop.txt:6: has 15 numbers; the days before have 16"));
    const std::string whole = series();
    EXPECT_THAT(error(whole.substr(whole.find("-0.67")), "-0.67"), HasSubstr("found 7 numbers"));
    EXPECT_THAT(error(whole.substr(whole.find("2015")), "nothing"), HasSubstr("has 0 days of EOP C04"));
    // Leap seconds that end before that of the series.
    const TemporaryFile file("eop.txt", series());
    const TemporaryFile leaps("leaps.tls", "KPL/LSK\n\\begindata\nDELTET/DELTA_T_A = 32.184\nDELTET/K = 1.657D-3\n"
                                           "DELTET/EB = 1.671D-2\nDELTET/M = ( 6.239996 1.99096871D-7 )\n"
                                           "DELTET/DELTA_AT = ( 35, @2012-JUL-1 )\n");
    EXPECT_THAT(error_of([&] { EarthRotation(of(file), TimeSystem::read(leaps.path())); }),
                HasSubstr("leaps.tls: has no leap second before 2015-07-01: UTC from then on needs a newer file"));
}

TEST(EarthRotation, refuses_numbers_that_cannot_be)
{
    EXPECT_THAT(error_of([] { EarthRotation({}, times); }), HasSubstr("needs UT1: a file of the IERS, or ut1_tai"));
    EXPECT_THAT(error_of([] { EarthRotation(numbers(Theory::iau2006, 500.0), times); }),
                HasSubstr("ut1_tai [s] must be within +-200; found 500"));
    EXPECT_THAT(error_of([] { EarthRotation(numbers(Theory::iau2006, -34.0, 0.3), times); }),
                HasSubstr("polar_motion [rad] must be within"));
    EXPECT_THAT(error_of([] {
                    EarthRotation({Theory::iau2006, "nope.txt", {}, {}}, times);
                }),
                HasSubstr("nope.txt: cannot be opened"));
}

TEST(EarthRotation, has_the_true_equator_and_equinox_of_date)
{
    const Epoch epoch = times.epoch("2020-06-01");
    const EarthRotation earth(numbers(Theory::iau2006, -37.2), times);
    EarthRotation::Window window;
    const Matrix3d to_date = true_of_date(Theory::iau2006, times, epoch);
    EXPECT_LT((to_date * to_date.transpose() - Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_LT((to_date.row(2) - earth.dcm_PN(epoch, 0.0, window).row(2)).norm(), 1e-12); // without polar motion
    // The equinox goes along the ecliptic by 50.29 arcsec a year.
    EXPECT_NEAR(std::acos(to_date(0, 0)) / arcsecond, 20.4 * 50.29, 20.0);
}

} // namespace earth_rotation_test
} // namespace fledge::world

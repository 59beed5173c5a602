// SPDX-License-Identifier: Apache-2.0
#include "world/environment/orientation.h"

#include "sim/error.h"
#include "world/environment/bodies.h"
#include "world/environment/ephemeris.h"
#include "world/environment/testing/files.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace fledge::world {
namespace orientation_test {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::real_file;

constexpr int bodies[] = {10, 199, 299, 399, 301, 499, 599, 699, 799, 899};
constexpr double deg = std::numbers::pi / 180.0;

/// R_i(angle), the frame turned about an axis.
Matrix3d turn(int axis, double degrees)
{
    return AngleAxisd(degrees * deg, Vector3d::Unit(axis)).toRotationMatrix().transpose();
}

TEST(Orientation, IsTheIausAnglesAboutThreeAxes)
{
    const Epoch epoch = TimeSystem().epoch("2015-03-02T12:00:00 TDB");
    const double d = epoch.seconds() / 86400.0, T = d / 36525.0;
    const Matrix3d mars = turn(2, std::fmod(176.630 + 350.89198226 * d, 360.0)) *
                          turn(0, 90.0 - (52.88650 - 0.0609 * T)) * turn(2, 90.0 + 317.68143 - 0.1061 * T);
    EXPECT_LT((Orientation::built_in(499).at(epoch).dcm_PN - mars).norm(), 1e-10);
}

TEST(Orientation, TurnsAtTheRateOfItsMatrix)
{
    // d[PN]/dt = -[omega x][PN], by central differences of two widths to remove their h^2.
    for (const int body : bodies) {
        const Orientation orientation = Orientation::built_in(body);
        for (const Epoch epoch : {Epoch{478'569'600'000'000'000}, Epoch{-1'234'567'890'123'456'789}}) {
            const BodyAttitude now = orientation.at(epoch);
            EXPECT_LT((now.dcm_PN * now.dcm_PN.transpose() - Matrix3d::Identity()).norm(), 1e-14);
            EXPECT_NEAR(now.dcm_PN.determinant(), 1.0, 1e-14);
            const auto slope = [&](double h) -> Matrix3d {
                return (orientation.at(epoch, h).dcm_PN - orientation.at(epoch, -h).dcm_PN) / (2.0 * h);
            };
            const double h = 0.003 / now.omega_PN_P.norm();
            const Matrix3d derivative = (4.0 * slope(h) - slope(2.0 * h)) / 3.0;
            const Matrix3d cross = -derivative * now.dcm_PN.transpose();
            const Vector3d omega(cross(2, 1), cross(0, 2), cross(1, 0));
            EXPECT_LT((omega - now.omega_PN_P).norm(), 1e-10 * omega.norm()) << body_name(body);
        }
    }
}

TEST(Orientation, BuiltInEqualsNaifsKernel)
{
    const std::string path = real_file("pck00008.tpc");
    SKIP_WITHOUT(path);
    const TextKernel pck = TextKernel::read(path);
    for (const int body : bodies) {
        const Orientation ours = Orientation::built_in(body), theirs = Orientation::from(pck, body);
        for (const Epoch epoch : {Epoch{0}, Epoch{478'569'600'000'000'000}}) {
            const BodyAttitude a = ours.at(epoch), b = theirs.at(epoch);
            EXPECT_LT((a.dcm_PN - b.dcm_PN).norm(), 1e-15) << body_name(body);
            EXPECT_LT((a.omega_PN_P - b.omega_PN_P).norm(), 1e-20) << body_name(body);
        }
        EXPECT_DOUBLE_EQ(body_radii(body).equatorial, equatorial_radius(pck, body));
        EXPECT_DOUBLE_EQ(body_radii(body).polar, polar_radius(pck, body));
    }
    // A moon whose terms refer to its planet's angles, most of which it does not use.
    EXPECT_GT(Orientation::from(pck, 514).at({0}).omega_PN_P[2], 0.0);
}

TEST(Orientation, ATermMayMoveOneAngleAlone)
{
    // E = 30 deg: right ascension and prime meridian get its sine, declination its cosine.
    const double sine = 0.5, cosine = std::sqrt(0.75);
    struct {
        const char *name;
        double ra, dec, pm;
    } const cases[] = {{"RA", 4.0 * sine, 0.0, 0.0}, {"DEC", 0.0, 4.0 * cosine, 0.0}, {"PM", 0.0, 0.0, 4.0 * sine}};
    for (const auto &[name, ra, dec, pm] : cases) {
        const std::string text = "\\begindata\nBODY501_POLE_RA = 10\nBODY501_POLE_DEC = 20\nBODY501_PM = 40\n"
                                 "BODY5_NUT_PREC_ANGLES = ( 30 0 )\nBODY501_NUT_PREC_";
        const TextKernel pck = TextKernel::parse(text + name + " = 4\n", "test.tpc");
        const Matrix3d expected = turn(2, 40.0 + pm) * turn(0, 70.0 - dec) * turn(2, 100.0 + ra);
        EXPECT_LT((Orientation::from(pck, 501).at({0}).dcm_PN - expected).norm(), 1e-14) << name;
    }
}

TEST(Orientation, TheMoonShowsUsOneFace)
{
    // The Earth stays within the librations (8 deg) of the Moon's prime meridian.
    if (!std::filesystem::exists(Ephemeris::de405_folder)) {
        GTEST_SKIP() << "not here: " << Ephemeris::de405_folder;
    }
    Ephemeris ephemeris;
    ephemeris.add_de405();
    const Orientation moon = Orientation::built_in(301);
    double most = 0.0;
    for (int day = 0; day < 3650; day += 3) {
        const Epoch epoch{day * 86'400'000'000'000};
        const Vector3d earth_N = ephemeris.state(399, 301, epoch).r;
        const Vector3d earth_P = moon.at(epoch).dcm_PN * earth_N;
        most = std::max(most, std::acos(earth_P[0] / earth_P.norm()) / deg);
        EXPECT_LT(std::fabs(std::asin(earth_P[2] / earth_P.norm())) / deg, 6.9);
    }
    EXPECT_LT(most, 10.6);
    EXPECT_GT(most, 7.0);
}

TEST(Orientation, NoonAtGreenwichIsUnderTheSun)
{
    // Within the equation of time (16.5 min) and 0.2 deg of model.
    if (!std::filesystem::exists(Ephemeris::de405_folder)) {
        GTEST_SKIP() << "not here: " << Ephemeris::de405_folder;
    }
    Ephemeris ephemeris;
    ephemeris.add_de405();
    const TimeSystem time;
    const Orientation earth = Orientation::built_in(399);
    double mean = 0.0;
    for (int day = 0; day < 365; day++) {
        const Epoch epoch{time.epoch("2019-01-01T12:00:00").ns + day * 86'400'000'000'000};
        const Vector3d sun = earth.at(epoch).dcm_PN * ephemeris.state(10, 399, epoch).r;
        const double longitude = std::atan2(sun[1], sun[0]) / deg;
        EXPECT_LT(std::fabs(longitude), 4.5);
        mean += longitude / 365.0;
    }
    EXPECT_LT(std::fabs(mean), 0.25);
}

TEST(Orientation, WhatIsMissingOrMisshapenIsNamed)
{
    const auto error = [](const std::string &text, int body) {
        return error_of([&] { Orientation::from(TextKernel::parse("\\begindata\n" + text, "test.tpc"), body); });
    };
    EXPECT_THROW(Orientation::built_in(2000433), sim::SetupError);
    EXPECT_THAT(error_of([] { Orientation::built_in(2000433); }),
                HasSubstr("no orientation is built in for body 2000433; it is for SUN (10)"));
    const std::string pole = "BODY501_POLE_RA = ( 1 2 )\nBODY501_POLE_DEC = 3\n";
    EXPECT_EQ(error(pole + "BODY501_PM = ( 1 2 3 )", 501), "");
    EXPECT_THAT(error(pole, 501), HasSubstr("test.tpc: does not define BODY501_PM"));
    EXPECT_THAT(error(pole + "BODY501_PM = ( 1 2 3 4 )", 501), HasSubstr(":4: BODY501_PM has 4 values"));
    const std::string terms = pole + "BODY501_PM = 1\nBODY501_NUT_PREC_RA = ( 1 2 )\n";
    EXPECT_THAT(error(terms, 501), HasSubstr("does not define BODY5_NUT_PREC_ANGLES"));
    EXPECT_THAT(error(terms + "BODY5_NUT_PREC_ANGLES = ( 1 2 3 )", 501),
                HasSubstr(":6: BODY5_NUT_PREC_ANGLES has 3 values; the terms of IO (501) need 4"));
    EXPECT_THAT(error(pole + "BODY501_PM = 1\nBODY501_CONSTANTS_REF_FRAME = 2", 501),
                HasSubstr("BODY501_CONSTANTS_REF_FRAME is 2; only 1 is read"));
}

} // namespace orientation_test
} // namespace fledge::world

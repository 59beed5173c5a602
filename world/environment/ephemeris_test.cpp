// SPDX-License-Identifier: Apache-2.0
#include "world/environment/ephemeris.h"

#include "sim/error.h"
#include "world/environment/bodies.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/kernel.h"

#include <Eigen/Dense>

#include <cmath>

namespace fledge::world {
namespace ephemeris_test {

using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::made_kernel;
using testing::real_file;
using testing::TemporaryFile;
using testing::turned_kernel;
using testing::uniform_motion;

constexpr std::int64_t second = 1'000'000'000;
constexpr std::int64_t day = 86'400 * second;
const Epoch noon{478'569'600 * second}; // 2015-03-02T12:00:00 TDB

Epoch at(double seconds)
{
    return {static_cast<std::int64_t>(seconds * 1e9)};
}

/// Position in km of the one moving axis.
double x(const Ephemeris &ephemeris, int target, int center, double t)
{
    return ephemeris.state(target, center, at(t)).r[0] / 1e3;
}

TEST(Bodies, HaveNamesAndNumbers)
{
    EXPECT_EQ(body_id("Mars"), 499);
    EXPECT_EQ(body_id("jupiter_barycenter"), 5);
    EXPECT_EQ(body_id("EMB"), 3);
    EXPECT_EQ(body_id("-82"), -82);
    EXPECT_EQ(body_name(301), "MOON (301)");
    EXPECT_EQ(body_name(-82), "body -82");
    EXPECT_THROW(body_id("Vulcan"), sim::SetupError);
    EXPECT_THAT(error_of([] { body_id("Vulcan"); }),
                HasSubstr("no body is named \"Vulcan\"; give a NAIF number or one of SOLAR SYSTEM"));
    EXPECT_THAT(error_of([] { body_mu(401); }), HasSubstr("is built in for PHOBOS (401)"));
    EXPECT_THAT(error_of([] { body_radii(3); }), HasSubstr("is built in for EARTH MOON BARYCENTER (3)"));
}

TEST(Bodies, GravitationalParametersAddUp)
{
    EXPECT_NEAR(body_mu(399) + body_mu(301), body_mu(3), 1e-10 * body_mu(3));
    EXPECT_NEAR(body_mu(499), body_mu(4), 1e-7 * body_mu(4));
    for (const int planet : {599, 699, 799, 899}) {
        EXPECT_LT(body_mu(planet), body_mu(planet / 100));
        EXPECT_GT(body_mu(planet), 0.9997 * body_mu(planet / 100));
    }
}

TEST(Ephemeris, SumsAlongTheTree)
{
    // 399 -> 3 -> 0 <- 10, as in every planetary kernel; the Moon hangs on 3.
    const TemporaryFile file(
        "tree.bsp", made_kernel({uniform_motion(3, 0, 0, 100, 1000, 1), uniform_motion(399, 3, 0, 100, -7, 0),
                                 uniform_motion(301, 3, 0, 100, 300, 0), uniform_motion(10, 0, 0, 100, 50, 0)}));
    Ephemeris ephemeris;
    ephemeris.add_spk(file.path());
    EXPECT_DOUBLE_EQ(x(ephemeris, 399, 10, 50), 1000 - 7 - 50);
    EXPECT_DOUBLE_EQ(x(ephemeris, 10, 399, 50), 50 + 7 - 1000);
    EXPECT_DOUBLE_EQ(x(ephemeris, 301, 399, 50), 307);
    EXPECT_DOUBLE_EQ(x(ephemeris, 3, 399, 50), 7);
    EXPECT_DOUBLE_EQ(x(ephemeris, 399, 3, 50), -7);
    EXPECT_EQ(x(ephemeris, 10, 10, 50), 0);
    EXPECT_DOUBLE_EQ(ephemeris.state(399, 10, at(50)).v[0], 1e3);
    EXPECT_THAT(ephemeris.bodies(), ElementsAre(0, 3, 10, 301, 399));
}

TEST(Ephemeris, LaterSegmentsAndFilesGoFirst)
{
    const TemporaryFile a("a.bsp",
                          made_kernel({uniform_motion(10, 0, 0, 100, 1, 0), uniform_motion(10, 0, 20, 40, 2, 0)}));
    const TemporaryFile b("b.bsp", made_kernel({uniform_motion(10, 0, 30, 60, 3, 0)}));
    Ephemeris ephemeris;
    ephemeris.add_spk(a.path());
    ephemeris.add_spk(b.path());
    Ephemeris::Cursor cursor; // one for all, so that it has to notice where a segment ends
    const auto which = [&](double t) { return ephemeris.position(10, 0, at(t), 0.0, cursor)[0] / 1e3; };
    for (const auto &[t, segment] : {std::pair{0.0, 1.0},
                                     {19.999, 1.0},
                                     {20.0, 2.0},
                                     {29.999, 2.0},
                                     {30.0, 3.0},
                                     {60.0, 3.0},
                                     {60.001, 1.0},
                                     {100.0, 1.0},
                                     {35.0, 3.0},
                                     {25.0, 2.0},
                                     {10.0, 1.0}}) {
        EXPECT_EQ(which(t), segment) << t;
        EXPECT_EQ(x(ephemeris, 10, 0, t), segment) << t;
    }
    // tau counts too.
    EXPECT_EQ(ephemeris.position(10, 0, at(0.0), 20.0, cursor)[0], 2e3);
}

TEST(Ephemeris, WhatIsNotCoveredIsNamedBeforeAnyStep)
{
    const TemporaryFile file("gap.bsp",
                             made_kernel({uniform_motion(10, 0, 0, 100, 1, 0), uniform_motion(4, 0, 0, 40, 2, 0),
                                          uniform_motion(4, 0, 60, 100, 2, 0), uniform_motion(5, 0, 0, 40, 2, 0),
                                          uniform_motion(5, 0, 40, 100, 2, 0)}));
    Ephemeris ephemeris;
    EXPECT_THAT(error_of([&] { ephemeris.state(10, 0, at(0)); }), HasSubstr("no file was added"));
    ephemeris.add_spk(file.path());
    EXPECT_TRUE(ephemeris.covers(4, 10, at(0), at(40)));
    EXPECT_TRUE(ephemeris.covers(4, 10, at(60), at(100)));
    EXPECT_FALSE(ephemeris.covers(4, 10, at(0), at(100)));
    EXPECT_FALSE(ephemeris.covers(4, 10, at(50), at(50)));
    EXPECT_TRUE(ephemeris.covers(5, 10, at(0), at(100)));
    EXPECT_FALSE(ephemeris.covers(5, 10, at(0), at(101)));
    EXPECT_NO_THROW(ephemeris.require(5, 10, at(0), at(100)));
    EXPECT_THROW(ephemeris.require(4, 10, at(0), at(100)), sim::SetupError);
    const std::string error = error_of([&] { ephemeris.require(4, 10, at(0), at(100)); });
    EXPECT_THAT(error, HasSubstr("MARS BARYCENTER (4) is given from 2000-01-01T12:00:00 TDB to "
                                 "2000-01-01T12:00:40 TDB in " +
                                 file.path()));
    EXPECT_THAT(error, HasSubstr(" and 2000-01-01T12:01:00 TDB to 2000-01-01T12:01:40 TDB in "));
    EXPECT_THAT(error, HasSubstr("; asked for MARS BARYCENTER (4) relative to SUN (10) from "
                                 "2000-01-01T12:00:00 TDB to 2000-01-01T12:01:40 TDB"));
    EXPECT_THAT(error_of([&] { ephemeris.state(4, 10, at(50)); }),
                HasSubstr("relative to SUN (10) at 2000-01-01T12:00:50 TDB"));
    // Mars stands for its barycentre, Jupiter does not.
    EXPECT_EQ(x(ephemeris, 499, 4, 10), 0);
    EXPECT_EQ(x(ephemeris, 499, 10, 10), 1);
    const std::string jupiter = error_of([&] { ephemeris.state(599, 10, at(0)); });
    EXPECT_THAT(jupiter, HasSubstr(file.path() + ": no JUPITER (599); asked for"));
    EXPECT_THAT(jupiter, HasSubstr("The barycentre of its system is there: JUPITER BARYCENTER (5)"));
    EXPECT_THAT(jupiter, HasSubstr("There are SOLAR SYSTEM BARYCENTER (0), MARS BARYCENTER (4)"));
}

TEST(Ephemeris, BodiesThatNothingConnectsAreNamed)
{
    const TemporaryFile file("two.bsp",
                             made_kernel({uniform_motion(10, 0, 0, 100, 1, 0), uniform_motion(501, 5, 0, 100, 2, 0)}));
    Ephemeris ephemeris;
    ephemeris.add_spk(file.path());
    EXPECT_THAT(error_of([&] { ephemeris.state(501, 10, at(1)); }),
                HasSubstr("nothing connects JUPITER BARYCENTER (5) with SOLAR SYSTEM BARYCENTER (0)"));
}

TEST(Ephemeris, KernelsThatGoInCirclesEnd)
{
    const TemporaryFile file("circle.bsp",
                             made_kernel({uniform_motion(1, 2, 0, 100, 1, 0), uniform_motion(2, 1, 0, 100, 2, 0),
                                          uniform_motion(3, 0, 0, 100, 2, 0)}));
    Ephemeris ephemeris;
    ephemeris.add_spk(file.path());
    EXPECT_FALSE(ephemeris.covers(1, 3, at(0), at(100)));
    EXPECT_THROW(ephemeris.state(1, 3, at(0)), sim::SetupError);
}

TEST(Ephemeris, TimeKeepsItsResolutionFarFromJ2000)
{
    // 1 km/s, 288 years past J2000: doubles of seconds there are 1.9e-6 s apart, 1.9 m.
    const double begin = 9.1e9;
    const TemporaryFile file("late.bsp", made_kernel({uniform_motion(10, 0, begin, begin + 1000, 0, 1)}));
    Ephemeris ephemeris;
    ephemeris.add_spk(file.path());
    Ephemeris::Cursor cursor;
    const Epoch middle{9'100'000'500 * second};
    for (const std::int64_t ns : {1, 10, 1000}) {
        EXPECT_NEAR(ephemeris.position(10, 0, {middle.ns + ns}, 0.0, cursor)[0], 1e-6 * ns, 1e-12);
        EXPECT_NEAR(ephemeris.position(10, 0, middle, 1e-9 * ns, cursor)[0], 1e-6 * ns, 1e-12);
    }
}

/// Each body's state against differences of its positions, four points to the fourth order.
void expect_consistent(const Ephemeris &ephemeris, int target, int center, Epoch epoch, double h, double v_tolerance,
                       double a_tolerance)
{
    Ephemeris::Cursor cursor;
    const auto slope = [&](auto &&f, double step) -> Vector3d {
        return (8.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (12.0 * step);
    };
    const BodyState state = ephemeris.state(target, center, epoch, 0.0, cursor);
    const Vector3d r = ephemeris.position(target, center, epoch, 0.0, cursor);
    EXPECT_EQ(r, state.r);
    const Vector3d v = slope([&](double t) { return ephemeris.position(target, center, epoch, t, cursor); }, h);
    const Vector3d a = slope([&](double t) { return ephemeris.state(target, center, epoch, t, cursor).v; }, h);
    EXPECT_LT((v - state.v).norm(), v_tolerance) << body_name(target);
    EXPECT_LT((a - state.a).norm(), a_tolerance) << body_name(target);
}

TEST(Ephemeris, VelocityAndAccelerationAreDerivatives)
{
    const std::string de430 = real_file("de430-2015-03-02.bsp");
    const std::string jup310 = real_file("jup310-excerpt.bsp");
    SKIP_WITHOUT(de430);
    Ephemeris ephemeris;
    ephemeris.add_spk(de430);
    for (const int body : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 301, 399, 499}) {
        expect_consistent(ephemeris, body, 0, noon, 600.0, 1e-5, 1e-9);
    }
    ephemeris.add_spk(jup310);
    const Epoch then{667'613'800 * second}; // not where two records meet
    // Type 3 has a polynomial of its own for the velocity, which is not quite the derivative. The
    // inner moons go around Jupiter within hours, so steps are short.
    for (const int moon : {501, 502, 503, 504, 505, 514, 515, 516}) {
        expect_consistent(ephemeris, moon, 5, then, 10.0, 2e-3, 1e-6);
    }
}

TEST(Ephemeris, TheOtherByteOrderGivesTheSameBits)
{
    const std::string path = real_file("de430-2015-03-02.bsp");
    SKIP_WITHOUT(path);
    const TemporaryFile file("turned.bsp", turned_kernel(read_whole(path)));
    Ephemeris a, b;
    a.add_spk(path);
    b.add_spk(file.path());
    for (const int body : {1, 4, 10, 301, 399}) {
        const BodyState p = a.state(body, 0, noon), q = b.state(body, 0, noon);
        EXPECT_EQ(p.r, q.r);
        EXPECT_EQ(p.v, q.v);
        EXPECT_EQ(p.a, q.a);
    }
}

TEST(Ephemeris, TheMoonOfDe441WasUnderApollo11)
{
    // A kernel whose bodies are split in two segments each, which join at 1969-07-29.
    const std::string path = real_file("de441-1969.bsp");
    SKIP_WITHOUT(path);
    Ephemeris ephemeris;
    ephemeris.add_spk(path);
    const Epoch joint{-960'120'000 * second};
    EXPECT_TRUE(ephemeris.covers(301, 399, {joint.ns - 4 * day}, {joint.ns + 4 * day}));
    EXPECT_FALSE(ephemeris.covers(301, 399, {joint.ns - 5 * day}, joint));
    Ephemeris::Cursor cursor;
    const auto moon = [&](std::int64_t ns) { return ephemeris.state(301, 399, {joint.ns + ns}, 0.0, cursor); };
    EXPECT_LT((moon(1).r - moon(-1).r).norm(), 1e-3);
    EXPECT_LT((moon(1).v - moon(-1).v).norm(), 1e-6);
}

// --- DE405 ---------------------------------------------------------------------------------------

class De405 : public ::testing::Test {
protected:
    void SetUp() override
    {
        if (!std::filesystem::exists(Ephemeris::de405_folder)) {
            GTEST_SKIP() << "not here: " << Ephemeris::de405_folder;
        }
        ephemeris.add_de405();
    }

    Ephemeris ephemeris;
};

TEST_F(De405, AgreesWithTheDayOfDe430)
{
    const std::string path = real_file("de430-2015-03-02.bsp");
    SKIP_WITHOUT(path);
    Ephemeris de430;
    de430.add_spk(path);
    // What ten more years of observations changed, relative to the Sun [m], [m/s].
    const struct {
        int target, center;
        double r, v;
    } tolerances[] = {
        {1, 10, 1e3, 2e-3},   {2, 10, 1.5e3, 5e-4}, {3, 10, 1e3, 5e-4}, {4, 10, 2e3, 5e-4},
        {5, 10, 200e3, 5e-3}, {6, 10, 1e6, 1e-2},   {7, 10, 4e6, 2e-2}, {8, 10, 8e6, 2e-2},
        {9, 10, 20e6, 5e-2},  {301, 399, 20, 1e-4}, {10, 0, 2e3, 1e-4}, {399, 3, 1.0, 1e-5},
    };
    for (const auto &t : tolerances) {
        for (int hour = -12; hour <= 12; hour += 4) {
            const Epoch epoch{noon.ns + hour * 3600 * second};
            const BodyState a = ephemeris.state(t.target, t.center, epoch);
            const BodyState b = de430.state(t.target, t.center, epoch);
            EXPECT_LT((a.r - b.r).norm(), t.r) << body_name(t.target);
            EXPECT_LT((a.v - b.v).norm(), t.v) << body_name(t.target);
        }
    }
}

TEST_F(De405, IsContinuousAcrossAllItsRecords)
{
    // The fit leaves steps where intervals meet; a wrong row or part would leave 1e6 m and more.
    const Epoch begin{(36912 * 2 - 103089) * (day / 2)}; // MJD 36912; J2000 is MJD 51544.5
    const struct {
        int target, center, days;
        double r, v;
    } joints[] = {{1, 0, 8, 0.5, 1e-4},  {2, 0, 16, 0.5, 1e-4},  {3, 0, 16, 0.5, 1e-4},   {4, 0, 32, 0.5, 1e-4},
                  {5, 0, 32, 0.5, 1e-4}, {6, 0, 32, 0.5, 1e-4},  {7, 0, 32, 0.5, 1e-4},   {8, 0, 32, 0.5, 1e-4},
                  {9, 0, 32, 0.5, 1e-4}, {10, 0, 16, 0.5, 1e-4}, {301, 399, 4, 0.5, 1e-4}};
    for (const auto &j : joints) {
        Ephemeris::Cursor cursor;
        for (std::int64_t d = j.days; d < 1143 * 32; d += j.days) {
            const Epoch joint{begin.ns + d * day};
            // Half a nanosecond to either side, over which no body moves a tenth of a millimetre.
            const BodyState before = ephemeris.state(j.target, j.center, joint, -0.5e-9, cursor);
            const BodyState after = ephemeris.state(j.target, j.center, joint, 0.5e-9, cursor);
            ASSERT_LT((after.r - before.r).norm(), j.r) << body_name(j.target) << ", day " << d;
            ASSERT_LT((after.v - before.v).norm(), j.v) << body_name(j.target) << ", day " << d;
        }
    }
    EXPECT_TRUE(ephemeris.covers(301, 10, begin, {begin.ns + 1143 * 32 * day}));
    EXPECT_FALSE(ephemeris.covers(301, 10, {begin.ns - second / 1000}, begin));
    EXPECT_FALSE(ephemeris.covers(301, 10, begin, {begin.ns + 1143 * 32 * day + second}));
}

TEST_F(De405, MovesAsItsVelocitySays)
{
    for (const int body : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 301, 399}) {
        expect_consistent(ephemeris, body, 0, noon, 600.0, 1e-5, 1e-9);
    }
    // The planets fall towards the Sun: its gravity explains all but the others' part in 1e3.
    for (const int body : {1, 2, 3, 4, 5}) {
        const BodyState s = ephemeris.state(body, 10, noon);
        const double r = s.r.norm();
        const Vector3d expected = -(body_mu(10) + body_mu(body)) / (r * r * r) * s.r;
        EXPECT_LT((s.a - expected).norm(), 1e-3 * expected.norm()) << body_name(body);
    }
}

TEST_F(De405, DamagedTablesAreRefused)
{
    namespace fs = std::filesystem;
    const std::string folder = ::testing::TempDir() + "fledge_de405";
    const auto error = [&](const std::string &dat, const std::string &f0i) {
        fs::create_directories(folder);
        std::ofstream(folder + "/table.dat", std::ios::binary) << dat;
        std::ofstream(folder + "/table.f0i", std::ios::binary) << f0i;
        const std::string text = error_of([&] { Ephemeris().add_de405(folder); });
        fs::remove_all(folder);
        return text;
    };
    const std::string dat = read_whole(std::string(Ephemeris::de405_folder) + "/table.dat");
    const std::string f0i = read_whole(std::string(Ephemeris::de405_folder) + "/table.f0i");
    for (std::size_t size = 0; size < dat.size() - 200; size += 331) {
        const std::string text = error(dat.substr(0, size), f0i);
        EXPECT_TRUE(text.find("table.dat: is ") != text.npos) << size << ": " << text;
    }
    for (const std::size_t size : {std::size_t{0}, std::size_t{20}, std::size_t{8176}, f0i.size() - 8}) {
        EXPECT_THAT(error(dat, f0i.substr(0, size)), HasSubstr("table.f0i: is damaged or cut short"));
    }
    std::string broken = f0i;
    broken[16 + 8160 * 7] = 2;
    EXPECT_THAT(error(dat, broken), HasSubstr("row 8 has no head"));
    EXPECT_THAT(error_of([] { Ephemeris().add_de405("/nowhere"); }),
                HasSubstr("/nowhere: JPL's ephemeris DE405 is not there: give the folder that holds its table.dat; "
                          "or, as root, run: apt-get install casacore-data-jpl-de405"));
}

} // namespace ephemeris_test
} // namespace fledge::world

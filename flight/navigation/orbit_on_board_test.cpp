// SPDX-License-Identifier: Apache-2.0
// Against the published verification of SGP4, the gradient of a potential, derivatives, and itself by other ways.
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/earth_orientation.h"
#include "flight/navigation/orbit_on_board.h"
}

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

namespace flight::testing {
namespace orbit_on_board_test {

constexpr std::int64_t day = 86'400'000'000'000;

/// The days from 2000-01-01 to a date's year and day of the year.
std::int64_t days(int year, int of_year)
{
    std::int64_t sum = of_year - 1;
    for (int y = 2000; y < year; y++) {
        sum += y % 4 == 0 ? 366 : 365;
    }
    for (int y = year; y < 2000; y++) {
        sum -= y % 4 == 0 ? 366 : 365;
    }
    return sum;
}

/// The elements of two lines, which are taken as right.
Sgp4Elements elements(const std::string &first, const std::string &second)
{
    const auto number = [](const std::string &line, std::size_t at, std::size_t n) {
        return std::stod(line.substr(at, n));
    };
    const double turn = 2 * pi, deg = pi / 180;
    const int year = std::stoi(first.substr(18, 2));
    const std::string digits = first.substr(53, 6);
    const double mantissa = std::stod((digits[0] == '-' ? "-." : ".") + digits.substr(1));
    return {(2 * days(year < 57 ? 2000 + year : 1900 + year, std::stoi(first.substr(20, 3))) - 1) * (day / 2) +
                std::llround(number(first, 24, 8)) * 864'000,
            number(second, 52, 11) * turn / 86400,
            number(second, 26, 7) * 1e-7,
            number(second, 8, 8) * deg,
            number(second, 17, 8) * deg,
            number(second, 34, 8) * deg,
            number(second, 43, 8) * deg,
            mantissa * std::pow(10.0, std::stod(first.substr(59, 2)))};
}

/// The lines of an orbit of each kind: near the Earth, of 6 hours, of a day, of half a day; and where the published
/// program has it after a day: r [km], v [km/s] (of tcppver.out of AIAA 2006-6753).
struct Published {
    const char *first, *second;
    double t;
    Vector3d r, v;
};

const Published published[] = {
    {"1 88888U          80275.98708465  .00073094  13844-3  66816-4",
     "2 88888  72.8435 115.9689 0086731  52.6988 110.5714 16.05824518",
     1440,
     {2742.55398832, -6079.67009123, -326.39012649},
     {1.948497651, 1.211072678, -7.356193131}},
    {"1 11801U          80230.29629788  .01431103  00000-0  14311-1",
     "2 11801  46.7916 230.4354 7318036  47.4722  10.4117  2.28537848",
     1440,
     {9787.87836256, 33753.32249667, -15030.79874625},
     {-1.094251553, 0.923589906, -1.522311008}},
    {"1 28626U 05008A   06176.46683397 -.00000205  00000-0  10000-3",
     "2 28626   0.0019 286.9433 0000335  13.7918  55.6504  1.00270176",
     1440,
     {42119.96263499, -1925.77567263, -0.19827433},
     {0.140521206, 3.071541613, 0.000179561}},
    {"1 08195U 75081A   06176.33215444  .00000099  00000-0  11873-3",
     "2 08195  64.1586 279.0717 6877146 264.7651  20.2257  2.00491383",
     1440,
     {2890.80638268, -15446.43952300, 948.77010176},
     {2.654407490, -2.909344895, 4.486437362}},
};

/// A two-line set's elements, with the epoch as the reference program has it: a Julian date, rounded to a double.
Sgp4Elements rounded(Sgp4Elements el)
{
    const double julian = static_cast<double>(el.epoch) / static_cast<double>(day) + 2451545.0;
    el.epoch = std::llround((julian - 2451545.0) * static_cast<double>(day));
    return el;
}

TEST(OrbitOnBoard, sgp4_is_the_published_one_for_each_kind_of_orbit)
{
    for (const Published &p : published) {
        Sgp4 s;
        Vec3 r, v;
        ASSERT_EQ(sgp4_init(&s, elements(p.first, p.second)), ORBIT_ELEMENTS_GOOD);
        ASSERT_EQ(sgp4_state(&s, 60 * p.t, &r, &v), ORBIT_ELEMENTS_GOOD);
        EXPECT_LT((eigen(r) / 1e3 - p.r).norm(), 1e-7) << p.first;
        EXPECT_LT((eigen(v) / 1e3 - p.v).norm(), 2e-9) << p.first;
        EXPECT_EQ(s.deep, p.second[52] == '1' ? 0U : 1U);
    }
}

/// All 33 sets and 667 lines, from Debian's python3-sgp4.
TEST(OrbitOnBoard, sgp4_is_the_published_one_for_the_whole_verification)
{
    const std::filesystem::path folder = "/usr/lib/python3/dist-packages/sgp4";
    std::ifstream sets(folder / "SGP4-VER.TLE"), lines(folder / "tcppver.out");
    if (!sets || !lines) {
        GTEST_SKIP() << "not installed: python3-sgp4";
    }
    // Sets that end before their time, and why.
    const std::map<std::string, int> ends = {{"22312", 1}, {"28350", 1}, {"28872", 6},
                                             {"29141", 6}, {"33333", 4}, {"33334", 3}};
    std::string line_1, line_2, line;
    double worst = 0, t = 0, last = 0, step = 0;
    int n = 0, points = 0;
    Sgp4 s;
    Vec3 r, v;
    const auto ended = [&](const std::string &number) {
        OrbitElementsCode code = ORBIT_ELEMENTS_GOOD;
        for (double next = t + step; code == ORBIT_ELEMENTS_GOOD && next <= last; next += step) {
            code = sgp4_state(&s, 60 * next, &r, &v);
        }
        EXPECT_EQ(code, ends.contains(number) ? ends.at(number) : 0) << number;
    };
    while (std::getline(lines, line)) {
        std::istringstream text(line);
        std::string first, second;
        text >> first >> second;
        if (second == "xx") {
            if (n++ > 0) {
                ended(line_2.substr(2, 5));
            }
            while (std::getline(sets, line_2) && line_2[0] != '2') {
                line_1 = line_2;
            }
            std::istringstream(line_2.substr(69)) >> t >> last >> step;
            ASSERT_EQ(sgp4_init(&s, rounded(elements(line_1, line_2))), ORBIT_ELEMENTS_GOOD);
            continue;
        }
        Vector3d r_km, v_km;
        t = std::stod(first);
        r_km.x() = std::stod(second);
        text >> r_km.y() >> r_km.z() >> v_km.x() >> v_km.y() >> v_km.z();
        const OrbitElementsCode code = sgp4_state(&s, 60 * t, &r, &v);
        if (line_2.substr(2, 5) == "33334") {
            EXPECT_EQ(code, ORBIT_ELEMENTS_PERTURBED); // the published line repeats the one before
            continue;
        }
        ASSERT_EQ(code, ORBIT_ELEMENTS_GOOD) << line;
        const double error = (eigen(r) / 1e3 - r_km).norm();
        EXPECT_LT(error, 5e-7) << line_2 << "\n" << line;
        EXPECT_LT((eigen(v) / 1e3 - v_km).norm(), 2e-9) << line_2 << "\n" << line;
        worst = std::max(worst, error);
        points++;
    }
    EXPECT_EQ(n, 33);
    EXPECT_EQ(points, 666);
    RecordProperty("worst_mm", std::to_string(worst * 1e6));
}

OrbitOnBoard module_of(const Sgp4Elements &el)
{
    OrbitOnBoard m{};
    m.par.epoch = el.epoch;
    m.par.n = el.n;
    m.par.e = el.e;
    m.par.i = el.i;
    m.par.node = el.node;
    m.par.periapsis = el.periapsis;
    m.par.M = el.M;
    m.par.bstar = el.bstar;
    return m;
}

OrbitOnBoard module_of(const Published &p)
{
    return module_of(elements(p.first, p.second));
}

/// The orbit at a time [s] since the epoch.
NavOrbit at(OrbitOnBoard &m, double t)
{
    m.in.time = {good(5), m.par.epoch + std::llround(t * 1e9)};
    orbit_on_board_update(&m, {5, 0});
    return m.out.orbit;
}

TEST(OrbitOnBoard, the_orbit_is_that_of_TEME_in_N_and_the_acceleration_a_potentials_gradient)
{
    const auto potential = [](const Vector3d &r) {
        const double size = r.norm(), sine = r.z() / size, ratio = SGP4_RADIUS / size;
        return SGP4_MU / size * (1 - SGP4_J2 * ratio * ratio * (1.5 * sine * sine - 0.5));
    };
    Random random{1};
    for (const Published &p : published) {
        OrbitOnBoard m = module_of(p);
        m.par.bstar = 0;
        for (int i = 0; i < 50; i++) {
            const double t = std::floor(random.real(-2e5, 2e5));
            const NavOrbit orbit = at(m, t);
            ASSERT_EQ(orbit.head.quality, QUALITY_GOOD);
            ASSERT_EQ(m.out.state.age, t);
            const Matrix3d teme = eigen(earth_teme(earth_days(m.in.time.time)));
            const Vector3d r = teme * eigen(orbit.r_BN_N), v = teme * eigen(orbit.v_BN_N);
            Sgp4 s = m.mem.sgp4;
            Vec3 r_teme, v_teme;
            sgp4_state(&s, t, &r_teme, &v_teme);
            EXPECT_LT((r - eigen(r_teme)).norm(), 1e-7);
            EXPECT_LT((v - eigen(v_teme)).norm(), 1e-10);
            const Vector3d a = teme * eigen(orbit.a_BN_N);
            for (int k = 0; k < 3; k++) {
                const auto along = [&](double d) { return potential(r + d * Vector3d::Unit(k)); };
                EXPECT_NEAR((derivative<double>(along, 1e4)), a[k], 1e-9 * a.norm());
            }
            // SGP4's velocity is not quite the derivative of its position; with drag it is less so.
            const auto position = [&](double d) -> Vector3d { return eigen(at(m, t + d).r_BN_N); };
            EXPECT_LT((derivative<Vector3d>(position, 8) - eigen(orbit.v_BN_N)).norm(), 4.0);
        }
    }
}

TEST(OrbitOnBoard, an_orbit_does_not_depend_on_earlier_requests)
{
    Random random{2};
    for (const Published &p : published) {
        OrbitOnBoard m = module_of(p);
        for (int i = 0; i < 200; i++) {
            const double t = std::floor(random.real(-1e6, 1e6));
            OrbitOnBoard fresh = module_of(p);
            const NavOrbit orbit = at(m, t);
            EXPECT_TRUE(same_content(orbit, at(fresh, t))) << t;
        }
    }
}

TEST(OrbitOnBoard, new_elements_count_at_once)
{
    OrbitOnBoard m = module_of(published[0]);
    for (const Published &p : published) {
        m.par = module_of(p).par;
        OrbitOnBoard fresh = module_of(p);
        EXPECT_TRUE(same_content(at(m, 3600), at(fresh, 3600)));
        EXPECT_EQ(std::memcmp(&m.mem, &fresh.mem, sizeof m.mem), 0);
        m.par.M += 1e-9; // one number alone
        EXPECT_FALSE(same_content(at(m, 3600), fresh.out.orbit));
    }
}

TEST(OrbitOnBoard, time_and_age_are_those_of_the_output)
{
    OrbitOnBoard m = module_of(published[0]);
    orbit_on_board_update(&m, {7, 0});
    EXPECT_TRUE(all_zero(m.out)) << "without time";
    at(m, -100);
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_GOOD);
    m.par.age_max = 50;
    at(m, -100);
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.state.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.state.age, -100);
    at(m, 49);
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_GOOD);
    at(m, 51);
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
    m.par.age_max = 0;
    m.in.time.head = {3, QUALITY_STALE, 1};
    orbit_on_board_update(&m, {9, 0});
    EXPECT_EQ(m.out.orbit.head.t, 3);
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
}

TEST(OrbitOnBoard, what_is_no_orbit_holds_it_and_says_why)
{
    const auto expect = [](const auto &change, double t, OrbitElementsCode code) {
        OrbitOnBoard m = module_of(published[0]);
        at(m, 0);
        const OrbitOnBoard before = m;
        change(m.par);
        at(m, t);
        EXPECT_EQ(m.out.state.code, code);
        EXPECT_EQ(m.out.state.head.sequence, 2U);
        EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
        EXPECT_EQ(m.out.orbit.head.sequence, 1U);
        EXPECT_TRUE(same_content(m.out.orbit, before.out.orbit));
        EXPECT_EQ(std::memcmp(&m.mem, &before.mem, sizeof m.mem), 0);
    };
    expect([](auto &par) { par.e = 1; }, 0, ORBIT_ELEMENTS_ECCENTRICITY);
    expect([](auto &par) { par.e = std::nan(""); }, 0, ORBIT_ELEMENTS_ECCENTRICITY);
    expect([](auto &par) { par.n = 0; }, 0, ORBIT_ELEMENTS_MOTION);
    expect([](auto &par) { par.M = HUGE_VAL; }, 0, ORBIT_ELEMENTS_UNSOUND);
    expect([](auto &par) { par.n = 2e-3; }, 0, ORBIT_ELEMENTS_DECAYED);
    expect([](auto &par) { par.bstar = 1; }, 86400, ORBIT_ELEMENTS_ECCENTRICITY);
    expect([](auto &par) { par = module_of(published[3]).par; }, 86400e3, ORBIT_ELEMENTS_FAR);
}

TEST(OrbitOnBoard, any_numbers_do_no_harm)
{
    Random random{3};
    for (int round = 0; round < runs(30000); round++) {
        OrbitOnBoard m = module_of(published[round % 4]);
        const Doubles par = doubles(m.par.n, m.par.e, m.par.i, m.par.node, m.par.periapsis, m.par.M, m.par.bstar);
        for (int i = 0; i < 1 + round % 3; i++) {
            *par[static_cast<std::size_t>(random.below(7))] = any_number(random);
        }
        const double t = random.real(-1, 1) * std::pow(10.0, random.below(10));
        m.in.time = {with(any_quality(random)), round % 99 == 0 ? INT64_MIN : std::llround(t * 1e9)};
        m.par.age_max = any_number(random);
        orbit_on_board_update(&m, {0, 0});
        expect_finite(doubles(m.out.orbit.r_BN_N, m.out.orbit.v_BN_N, m.out.orbit.a_BN_N, m.out.state.age), round);
        if (m.out.orbit.head.quality == QUALITY_GOOD) {
            ASSERT_GE(vec_norm(m.out.orbit.r_BN_N), 0.999999 * SGP4_RADIUS) << round;
        }
    }
}

} // namespace orbit_on_board_test
} // namespace flight::testing

// SPDX-License-Identifier: Apache-2.0
// Passes against a search on a grid of 2 s along an orbit by another integrator, with the elevation from the station's
// ellipsoid by Eigen.
#include "flight/navigation/testing/orbits.h"
#include "flight/testing/consistency.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/ground_pass.h"
}

#include <vector>

namespace flight::testing {
namespace ground_pass_test {

using namespace orbits;

constexpr double degree = pi / 180;

struct Pass {
    double rise = -1, highest = -1, set = -1, elevation = -2;
};

double elevation(const GroundPass &m, const Earth &earth, double t, const State &x)
{
    // The point of the ellipsoid whose normal has the latitude, as a sum of its axes.
    const double lo = m.par.longitude, la = m.par.latitude, a = m.par.radius, b = a * (1 - m.par.flattening);
    const Vector3d up(std::cos(la) * std::cos(lo), std::cos(la) * std::sin(lo), std::sin(la));
    const Vector3d axes2(a * a, a * a, b * b);
    const Vector3d foot = axes2.cwiseProduct(up) / std::sqrt(up.dot(axes2.cwiseProduct(up)));
    const Vector3d d = earth.dcm(t) * x.head<3>() - foot - m.par.altitude * up;
    return pi / 2 - std::atan2(up.cross(d).norm(), up.dot(d));
}

/// The passes that end within `span`, on a grid of 2 s, and of 20 s far below the mask.
std::vector<Pass> search(const GroundPass &m, const Earth &earth, State x, double span, std::size_t most = 1000)
{
    std::vector<Pass> all;
    double before = elevation(m, earth, 0, x), earlier = before;
    Pass pass;
    bool above = before >= m.par.mask;
    if (above) {
        pass = {0, 0, -1, before};
    }
    double step = 2;
    for (double t = 0; t < span && all.size() < most; t += step) {
        step = before > m.par.mask - 0.15 ? 2 : 20;
        x = earth.step(t, x, step);
        const double now = elevation(m, earth, t + step, x), part = (m.par.mask - before) / (now - before);
        if (above && before > earlier && now <= before) { // a parabola through three points
            const double bend = earlier - 2 * before + now, offset = 0.5 * (earlier - now) / bend;
            const double top = before - 0.125 * (earlier - now) * (earlier - now) / bend;
            if (top > pass.elevation) {
                pass.elevation = top;
                pass.highest = t + offset * step;
            }
        }
        if (!above && now >= m.par.mask) {
            pass = {t + part * step, t + step, -1, now};
            above = true;
        } else if (above && now < m.par.mask) {
            pass.set = t + part * step;
            all.push_back(pass);
            above = false;
        }
        earlier = before;
        before = now;
    }
    return all;
}

struct Case {
    GroundPass m{};
    Earth earth;
    State x;

    explicit Case(Random &random)
    {
        earth.c = random.attitude();
        earth.J3 = earth.J4 = 0;
        m.par.longitude = random.real(-pi, pi);
        m.par.latitude = random.real(-1.5, 1.5);
        m.par.altitude = random.real(-100, 3000);
        m.par.radius = radius_earth;
        m.par.flattening = 1 / 298.257223563;
        m.par.mask = random.real(-1, 20) * degree;
        m.par.mu = mu_earth;
        m.par.J2 = J2_earth;
        m.par.horizon = 86400;
        m.par.step = 30;
        m.par.differ = 2000;
        m.par.steps = 20;
        put(on_orbit(random, random.real(6.8e6, 8e6), random.real(0, 0.02), random.real(0, pi)));
    }

    /// In an orbit whose inclination is about the planet's pole, when given in its axes.
    void put(const State &x_N)
    {
        x = x_N;
        m.in.orbit = {good(), vec(x.head<3>()), vec(x.tail<3>()), {}};
        m.in.planet = earth.attitude(0);
    }

    void put_about_pole(State x_P)
    {
        State x_N;
        x_N << earth.c.transpose() * x_P.head<3>(), earth.c.transpose() * x_P.tail<3>();
        put(x_N);
    }

    /// With time at rest until it is found; how many updates that took.
    int found()
    {
        int n = 0;
        do {
            ground_pass_update(&m, {0, 0});
            n++;
        } while (m.out.forecast.state == PASS_SEARCHING && n < 1000);
        return n;
    }

    double expect_as(const Pass &pass, double most = 0.5)
    {
        const double rise = 1e-9 * static_cast<double>(m.out.forecast.rise),
                     set = 1e-9 * static_cast<double>(m.out.forecast.set);
        const double error = std::max(std::abs(rise - pass.rise), std::abs(set - pass.set));
        EXPECT_NEAR(rise, pass.rise, most);
        EXPECT_NEAR(set, pass.set, most);
        // Near the zenith the grid's parabola is a poor one.
        EXPECT_NEAR(m.out.forecast.elevation, pass.elevation, pass.elevation > 1.45 ? 1e-2 : 1e-3);
        EXPECT_NEAR(1e-9 * static_cast<double>(m.out.forecast.highest), pass.highest, most + 1);
        EXPECT_EQ(m.out.forecast.head.quality, QUALITY_GOOD);
        return error;
    }
};

TEST(GroundPass, finds_the_first_pass_that_a_fine_grid_finds)
{
    Random random{1};
    int none = 0, within = 0, most = 0, n = campaign_runs(40, 1000);
    double worst = 0, ahead = 0;
    for (int i = 0; i < n; i++) {
        Case c(random);
        if (i % 3 == 1) { // polar, or over the equator
            c.put_about_pole(on_orbit(random, 6.9e6, 0.001, random.below(2) ? pi / 2 : 0.01));
        }
        most = std::max(most, c.found());
        const auto passes = search(c.m, c.earth, c.x, 86400, 1);
        if (passes.empty()) {
            none++;
            EXPECT_TRUE(c.m.out.forecast.state == PASS_NONE || c.m.out.forecast.set > 86400 * second) << i;
            continue;
        }
        ASSERT_EQ(c.m.out.forecast.state, passes[0].rise > 0 ? PASS_FOUND : PASS_NOW) << i;
        within += passes[0].rise <= 0;
        worst = std::max(worst, c.expect_as(passes[0]));
        ahead = std::max(ahead, passes[0].rise);
    }
    std::printf("%d cases: %d never seen, %d begin in a pass, worst of rise and set %.3f s, up to %.0f s ahead; %d "
                "updates at most\n",
                n, none, within, worst, ahead, most);
    EXPECT_GT(none, n < 40 ? -1 : 0); // the sanitizers fly few
    EXPECT_LT(none, n / 2);
    EXPECT_LE(most, 2 + 2 * 86400 / 30 / 20);
}

TEST(GroundPass, passes_that_graze_the_mask)
{
    Random random{2};
    int tried = 0;
    double shortest = 1e9;
    for (int i = 0; tried < runs(20); i++) {
        Case c(random);
        const auto passes = search(c.m, c.earth, c.x, 40000, 1);
        if (passes.empty() || passes[0].rise <= 0 || passes[0].elevation > 1.3) {
            continue;
        }
        tried++;
        const double top = passes[0].elevation;
        c.m.par.mask = top - 2e-5; // below: for some seconds
        c.found();
        ASSERT_EQ(c.m.out.forecast.state, PASS_FOUND);
        const double rise = 1e-9 * static_cast<double>(c.m.out.forecast.rise),
                     set = 1e-9 * static_cast<double>(c.m.out.forecast.set);
        shortest = std::min(shortest, set - rise);
        EXPECT_LT(rise, passes[0].highest + 1);
        EXPECT_GT(set, passes[0].highest - 1);
        EXPECT_LT(set - rise, 15);
        EXPECT_NEAR(c.m.out.forecast.elevation, top, 1e-5);
        c.m.par.mask = top + 2e-5; // above: the mask's change begins a new search, which does not find this one
        c.found();
        EXPECT_TRUE(c.m.out.forecast.state == PASS_NONE ||
                    c.m.out.forecast.rise > std::llround(1e9 * (passes[0].set + 60)));
    }
    std::printf("shortest: %.2f s\n", shortest);
    EXPECT_LT(shortest, 6);
}

TEST(GroundPass, polar_station_and_equatorial_orbit)
{
    Random random{3};
    Case c(random);
    c.m.par.latitude = 1.5;
    c.m.par.mask = 5 * degree;
    c.put_about_pole(on_orbit(random, 6.9e6, 0.001, 0.02));
    c.found();
    EXPECT_EQ(c.m.out.forecast.state, PASS_NONE);
    EXPECT_EQ(c.m.out.forecast.head.quality, QUALITY_GOOD);
    EXPECT_EQ(c.m.out.forecast.rise, 0);
    c.put_about_pole(on_orbit(random, 6.9e6, 0.001, pi / 2)); // it is elsewhere: farther than `differ`
    c.m.in.orbit.head.t = second;
    ground_pass_update(&c.m, {second, second});
    EXPECT_NE(c.m.out.forecast.state, PASS_NONE);
    c.m.in.orbit.head.t = 0;
    c.found();
    EXPECT_TRUE(c.m.out.forecast.state == PASS_FOUND || c.m.out.forecast.state == PASS_NOW);
    EXPECT_LT(c.m.out.forecast.rise, 6000 * second) << "each orbit";
}

/// What flies has more terms than the prediction knows: at each rise and set, the forecast has come true.
TEST(GroundPass, flies_a_day_beside_the_truth)
{
    Random random{4};
    double worst[2] = {0, 0};
    std::size_t count = 0;
    std::uint32_t searches = 0;
    for (int i = 0; i < campaign_runs(4, 40); i++) {
        Case c(random);
        c.m.par.differ = i % 2 ? 300 : 3000;
        c.m.par.latitude = random.real(0.3, 1.2);
        c.m.par.mask = 5 * degree;
        c.put_about_pole(on_orbit(random, 6.9e6, 0.001, 1.7));
        c.earth.J3 = J3_earth;
        c.earth.J4 = J4_earth;
        c.earth.C22 = 1.57446e-6;
        c.earth.S22 = -9.0386e-7;
        c.earth.drag = 3e-15;
        const auto passes = search(c.m, c.earth, c.x, 86400);
        std::vector<PassForecast> forecasts;
        State x = c.x;
        for (std::int64_t t = 0; t < 86400; t += 5) {
            c.m.in.orbit = {good(t * second), vec(x.head<3>()), vec(x.tail<3>()), {}};
            c.m.in.planet = c.earth.attitude(t * second);
            ground_pass_update(&c.m, {t * second, t > 0 ? 5 * second : 0});
            const PassForecast &pass = c.m.out.forecast;
            if (pass.state != PASS_SEARCHING && pass.state != PASS_NONE) {
                const bool same =
                    !forecasts.empty() && std::abs(static_cast<double>(pass.rise - forecasts.back().rise)) < 100e9;
                same ? void(forecasts.back() = pass) : forecasts.push_back(pass);
            }
            x = c.earth.step(static_cast<double>(t), x, 5);
        }
        count += passes.size();
        searches += i % 2 ? c.m.out.forecast.searches : 0;
        ASSERT_GE(forecasts.size(), passes.size());
        ASSERT_LE(forecasts.size(), passes.size() + 1);
        for (std::size_t k = 0; k < passes.size(); k++) {
            const double rise = 1e-9 * static_cast<double>(forecasts[k].rise),
                         set = 1e-9 * static_cast<double>(forecasts[k].set);
            worst[i % 2] = std::max({worst[i % 2], std::abs(rise - passes[k].rise), std::abs(set - passes[k].set)});
        }
    }
    std::printf("%zu passes, worst of rise and set %.2f s; %.2f s where 300 m begin a new search, %u of them\n", count,
                worst[0], worst[1], searches);
    EXPECT_LT(worst[0], 1);
    EXPECT_LT(worst[1], 0.5);
}

TEST(GroundPass, a_horizon_within_a_step_has_no_end_of_a_pass)
{
    Random random{6};
    Case c(random);
    c.m.par.latitude = c.m.par.longitude = c.m.par.mask = 0;
    c.put_about_pole((State() << 7e6, 0, 0, 0, 7.5e3, 0).finished()); // overhead
    c.m.par.horizon = 60;
    c.m.par.step = 600;
    EXPECT_EQ(c.found(), 1);
    EXPECT_EQ(c.m.out.forecast.state, PASS_NONE);
    c.m.par.step = 30;
    ground_pass_update(&c.m, {1, 1});
    EXPECT_EQ(c.m.out.forecast.state, PASS_NOW) << "until the horizon";
    EXPECT_EQ(c.m.out.forecast.set, 120 * second);
}

TEST(GroundPass, missing_stale_and_bad_data)
{
    Random random{5};
    Case c(random);
    c.m.par.latitude = 1;
    c.m.par.mask = 0;
    c.put_about_pole(on_orbit(random, 6.9e6, 0.001, pi / 2));
    const GroundPass fresh = c.m;
    for (int k = 0; k < 4; k++) {
        c.m = fresh;
        (k < 2 ? c.m.in.orbit.head : c.m.in.planet.head).quality = QUALITY_NONE;
        if (k % 2) {
            c.m = fresh;
            k == 1 ? void(c.m.in.orbit.r_BN_N = vec3(0, 0, 0)) : void(c.m.in.planet.dcm_PN = mat(Matrix3d::Ones()));
        }
        ground_pass_update(&c.m, {0, 0});
        EXPECT_TRUE(all_zero(c.m.out)) << k;
    }
    c.m = fresh;
    c.found();
    const PassForecast before = c.m.out.forecast;
    EXPECT_EQ(before.head.quality, QUALITY_GOOD);
    for (int k = 1; k <= 20; k++) { // no new orbits
        ground_pass_update(&c.m, {k * second, second});
        EXPECT_EQ(c.m.out.forecast.head.quality, k <= 10 ? QUALITY_GOOD : QUALITY_DEGRADED) << k;
        EXPECT_EQ(c.m.out.forecast.rise, before.rise);
    }
    const std::int64_t over = before.set + second;
    ground_pass_update(&c.m, {before.rise + second, second});
    EXPECT_EQ(c.m.out.forecast.state, PASS_NOW);
    ground_pass_update(&c.m, {over, second});
    for (int k = 0; k < 200 && c.m.out.forecast.state == PASS_SEARCHING; k++) {
        ground_pass_update(&c.m, {over, second});
    }
    EXPECT_EQ(c.m.out.forecast.head.quality, QUALITY_DEGRADED);
    EXPECT_GT(c.m.out.forecast.rise, before.set) << "from the old orbit, but not the old pass again";
    EXPECT_EQ(c.m.out.forecast.searches, 2u);

    for (int round = 0; round < 3000; round++) {
        GroundPass m = round % 2 ? fresh : c.m;
        throw_numbers(doubles(m.in.orbit.r_BN_N, m.in.orbit.v_BN_N), random, round);
        if (round % 5) {
            auto all = doubles(m.in.planet.dcm_PN, m.in.planet.omega_PN_N, m.par.longitude, m.par.latitude, m.par.mask,
                               m.par.horizon, m.par.step, m.par.differ, m.par.flattening, m.par.altitude);
            throw_numbers(all, random, round);
        }
        m.in.orbit.head = {random.below(3) ? over : INT64_MIN, any_quality(random), 2};
        for (int k = 0; k < 3; k++) {
            const std::int64_t times[] = {INT64_MIN, 0, over, over + 10 * second, INT64_MAX};
            ground_pass_update(&m, {times[random.below(5)], second});
            expect_finite(doubles(m.out.forecast.elevation), round);
            EXPECT_LE(m.out.forecast.rise, m.out.forecast.set);
        }
    }
}

} // namespace ground_pass_test
} // namespace flight::testing

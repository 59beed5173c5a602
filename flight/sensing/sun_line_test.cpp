// SPDX-License-Identifier: Apache-2.0
// A body that turns, with eight coarse sun sensors along the corners of a cube, with and without a gyro.
#include "flight/testing/consistency.h"
#include "flight/testing/eigen.h"
#include "flight/testing/linear.h"

extern "C" {
#include "flight/sensing/sun_line.h"
}

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace flight::testing {
namespace sun_line_test {

struct Flown {
    SunLine m{};
    Random random;
    bool gyro;
    Vector3d s, omega, bias;
    std::int64_t t = 0;
    double step = 0.2, brightness = 1, rest = 0; ///< [s] rest: how long the body takes to come to rest, if it does
    Vector3d begun = Vector3d::Zero();           ///< [rad/s] its rate at the begin, then
    std::function<void(Flown &)> fault;

    Flown(std::uint64_t seed, bool gyro_) : random(seed), gyro(gyro_)
    {
        m.par.noise = 0.01;
        m.par.length = 0.05;
        m.par.rate_noise = gyro ? 1e-8 : 1e-12;
        m.par.walk = gyro ? 1e-14 : 1e-8;
        m.par.rate_std = gyro ? 1e-3 : 0.02;
        m.par.gate = 5;
        m.par.good = 0.1;
        m.par.hold = 2;
        m.par.persistence = 5;
        s = random.direction();
        omega = gyro ? Vector3d(0.05 * random.direction()) : Vector3d(0.02 * random.normals());
        bias = 1e-3 * random.normals();
        sun_line_reset(&m);
        std::vector<Vector3d> corners;
        for (unsigned i = 0; i < 8; i++) {
            corners.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
        }
        measure(corners);
    }

    /// Sensors along these axes, four of them with less noise than the others.
    void measure(const std::vector<Vector3d> &axes)
    {
        SunCosines &cosines = m.in.cosines;
        cosines.n = static_cast<std::uint32_t>(axes.size());
        for (unsigned i = 0; i < cosines.n; i++) {
            cosines.axes_B[i] = vec_unit(vec(axes[i]));
            cosines.weight[i] = i < 4 ? 1 : 0.25;
        }
    }

    void update()
    {
        if (t > 0) {
            const Vector3d before = omega;
            if (!gyro) {
                omega += std::sqrt(m.par.walk * step) * random.normals();
            } else if (rest > 0) {
                omega = begun * std::max(0.0, 1 - 1e-9 * static_cast<double>(t) / rest);
            }
            const Vector3d mean = gyro ? Vector3d((before + omega) / 2) : omega;
            s = turn(mean, mean.norm() * step + 1e-300) * s;
            bias += std::sqrt((gyro ? m.par.walk : 0) * step) * random.normals();
        }
        SunCosines &cosines = m.in.cosines;
        cosines.head = good(t);
        cosines.lit = 0;
        for (unsigned i = 0; i < cosines.n; i++) {
            const double cosine = brightness * eigen(cosines.axes_B[i]).dot(s);
            cosines.cosine[i] = std::max(0.0, cosine) + m.par.noise / std::sqrt(cosines.weight[i]) * random.normal();
            cosines.lit |= cosine > 0.1 ? 1u << i : 0;
        }
        if (gyro) {
            m.in.gyro = {good(t), vec(omega + bias + std::sqrt(m.par.rate_noise / step) * random.normals())};
        }
        if (fault) {
            fault(*this);
        }
        const auto ns = static_cast<std::int64_t>(std::lround(step * 1e9));
        sun_line_update(&m, {t, t ? ns : 0});
        t += ns;
    }
    void run(double seconds)
    {
        for (int i = 0; i < std::lround(seconds / step); i++) {
            update();
        }
    }

    double error() const { return (eigen(m.out.heading.s_B) - s).norm(); }
    double rate_error() const { return (eigen(m.out.rate.omega_BN_B) - omega).cross(s).norm(); }
    Quality quality() const { return m.out.heading.head.quality; }

    /// The squares of the errors by their covariance: of the direction and of the rate across it, four numbers.
    double normalised_error() const
    {
        Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> root(&m.mem.root[0][0]);
        const Vector3d a = s.unitOrthogonal(), b = s.cross(a), d = eigen(m.mem.d_B);
        Eigen::Matrix<double, 4, 6> to = Eigen::Matrix<double, 4, 6>::Zero();
        to.topLeftCorner<1, 3>() = to.block<1, 3>(2, 3) = a.transpose();
        to.block<1, 3>(1, 0) = to.bottomRightCorner<1, 3>() = b.transpose();
        Eigen::Matrix<double, 6, 1> error;
        error << d.norm() * s - d, (gyro ? Vector3d(-bias) : omega) - eigen(m.mem.b_B);
        const Eigen::Matrix4d P = to * root.transpose() * root * to.transpose();
        return (to * error).dot(solve(P, to * error));
    }
};

/// Any noise, sensors, rates and times in the dark, and a brightness that is wrong by as much as `length` says.
/// fade: [s] how long a half-shadow lasts.
Flown any_flown(std::uint64_t seed, bool gyro, int sensors, double fade = 0)
{
    Flown f(seed, gyro);
    Random &random = f.random;
    f.step = random.below(2) ? 0.2 : 0.5;
    f.m.par.noise = 0.002 * std::pow(5, random.real(0, 1));
    f.m.par.length = 0.001 * std::pow(50, random.real(0, 1));
    f.m.par.rate_noise = gyro ? std::pow(10, random.real(-10, -7)) : 1e-12;
    f.m.par.walk = std::pow(10, gyro ? random.real(-16, -12) : random.real(-10, -8));
    f.m.par.persistence = static_cast<std::uint32_t>(5 + random.below(20));
    f.omega = f.begun = gyro ? Vector3d(random.real(0, 0.08) * random.direction()) : f.omega;
    f.rest = random.below(2) ? random.real(10, 100) : 0;
    std::vector<Vector3d> axes;
    for (int i = 0; sensors == 1 && i < 6; i++) {
        axes.emplace_back((i % 2 ? 1 : -1) * Vector3d::Unit(i / 2));
    }
    for (int i = 0; sensors == 2 && i < 8; i++) { // two pyramids
        axes.emplace_back((i % 2 ? 1 : -1) * Vector3d::Unit(i / 2 % 2) + (i < 4 ? 1 : -1) * Vector3d::UnitZ());
    }
    for (int i = 0, n = sensors == 3 ? 6 + random.below(3) : 3 + random.below(3); sensors > 2 && i < n; i++) {
        axes.push_back(random.direction());
    }
    if (sensors > 0) {
        f.measure(axes);
    }
    const bool lit = random.below(4) != 0;
    const double bright = 1 + f.m.par.length * random.normal();
    f.brightness = lit ? bright : 0;
    f.fault = [=, lit = lit, next = std::exp(random.real(1, 6))](Flown &flown) mutable { // for the next update
        if (1e-9 * static_cast<double>(flown.t) > next) {
            lit = !lit;
            next += std::exp(flown.random.real(1, 6));
        }
        const double change = fade > 0 ? flown.step / fade : 1;
        flown.brightness = std::clamp(flown.brightness + (lit ? change : -change), 0.0, bright);
    };
    return f;
}

TEST(SunLine, its_errors_are_as_large_as_it_says_wherever_it_is_good)
{
    // At a random time of each run; and hardly ever is it good and far from the Sun.
    for (int kind = 0; kind < 10; kind++) {
        const bool gyro = kind % 2;
        double all = 0, direction = 0, rate = 0;
        int n = 0, far = 0;
        for (int seed = 1; seed <= campaign_runs(100, 1000); seed++) {
            Flown f = any_flown(static_cast<std::uint64_t>(10 * seed + kind), gyro, kind / 2);
            const int steps = static_cast<int>(f.random.real(20, 600) / f.step), from = f.random.below(steps);
            bool looked = false, off = false;
            double of_run[3] = {0, 0, 0};
            for (int k = 0; k < steps; k++) {
                f.update();
                if (f.quality() != QUALITY_GOOD) {
                    continue;
                }
                off = off || f.error() > 8 * f.m.out.state.std;
                if (k >= from && !looked) {
                    looked = true;
                    of_run[0] = f.normalised_error();
                    of_run[1] = std::pow(f.error() / f.m.out.state.std, 2);
                    of_run[2] = std::pow(f.rate_error() / f.m.out.state.rate_std, 2);
                }
            }
            n += looked && !off; // those that are far are counted, and not averaged
            all += off ? 0 : of_run[0];
            direction += off ? 0 : of_run[1];
            rate += off ? 0 : of_run[2];
            far += off;
        }
        SCOPED_TRACE("sensors " + std::to_string(kind / 2) + (gyro ? ", with a gyro" : ", without a gyro"));
        expect_chi_square(all / n, 4, n);
        EXPECT_NEAR(direction / n, 1, 5 / std::sqrt(n)); // of two axes that differ: between one number and two
        EXPECT_NEAR(rate / n, 1, 5 / std::sqrt(n));
        EXPECT_LE(far, campaign_runs(100, 1000) / 500);
        EXPECT_GT(n, campaign_runs(100, 1000) / 3);
    }
}

TEST(SunLine, a_half_shadow_seldom_misleads_it)
{
    // What fades is no direction, but sensors do not say that they fade.
    const int n = campaign_runs(200, 10'000);
    int misled = 0;
    double worst = 0;
    for (int seed = 1; seed <= n; seed++) {
        Flown f = any_flown(static_cast<std::uint64_t>(seed), seed % 2, seed / 2 % 3, 8);
        f.m.par.persistence = static_cast<std::uint32_t>(std::lround(10 / f.step));
        double off = 0;
        for (int k = 0; k < std::lround(300 / f.step); k++) {
            f.update();
            off = std::max(off, f.quality() == QUALITY_GOOD && f.error() > 8 * f.m.out.state.std ? f.error() : 0);
        }
        misled += off > 0;
        worst = std::max(worst, off);
    }
    EXPECT_LE(misled, n / 20);
    EXPECT_LT(worst, 1.0);
}

TEST(SunLine, two_sensors_have_two_suns_until_a_third_is_lit)
{
    for (std::uint64_t seed = 1; seed <= 20; seed++) {
        Flown f(seed, seed % 2);
        f.measure({{1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}, {-1, 0, 1}, {-1, 0, -1}, {0, -1, 1}, {0, -1, -1}});
        f.omega *= 0;
        f.m.par.rate_std = 1e-5;
        f.m.par.walk = 1e-14;
        f.s = Vector3d(1, seed % 4 < 2 ? 0.1 : -0.1, 0.02).normalized();
        f.run(60);
        EXPECT_EQ(f.m.out.state.used, 2u);
        EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
        EXPECT_LT(f.error(), 0.15) << "between both";
        f.s = Vector3d(1, seed % 4 < 2 ? 0.25 : -0.25, 0.02).normalized();
        f.run(1);
        EXPECT_GE(f.m.out.state.used, 3u);
        EXPECT_EQ(f.quality(), QUALITY_GOOD);
        EXPECT_LT(f.error(), 0.05);
        EXPECT_EQ(f.m.out.state.restarts, 0u);
    }
}

TEST(SunLine, a_length_that_is_sure_does_no_harm)
{
    for (const double length : {0.05, 0.001, 1e-6}) {
        for (std::uint64_t seed = 1; seed <= 20; seed++) {
            Flown f(seed, true);
            f.m.par.length = length;
            f.run(1);
            EXPECT_LT(f.error(), 0.05) << length;
            f.run(20);
            EXPECT_EQ(f.quality(), QUALITY_GOOD) << length;
            EXPECT_LT(f.error(), 0.02) << length;
        }
    }
}

TEST(SunLine, where_one_of_three_sensors_differs_it_is_not_good)
{
    Flown f(5, true);
    f.omega *= 0;
    f.s = Vector3d(1, 0.3, 0.1).normalized();
    f.run(20);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    f.fault = [](Flown &flown) {
        unsigned left = 3;
        for (unsigned i = 0; i < 8; i++) {
            const bool lit = flown.m.in.cosines.lit >> i & 1;
            flown.m.in.cosines.lit &= left > 0 || !lit ? 0xFFu : ~(1u << i);
            flown.m.in.cosines.cosine[i] += lit && left == 1 ? 0.3 : 0;
            left -= lit && left > 0;
        }
    };
    f.run(20);
    EXPECT_EQ(f.m.out.state.used, 2u);
    EXPECT_EQ(f.quality(), QUALITY_DEGRADED) << "which one is wrong, two cannot say";
    EXPECT_LT(f.error(), 0.05);
    f.fault = nullptr;
    f.brightness = 0;
    f.run(1);
    EXPECT_EQ(f.quality(), QUALITY_DEGRADED) << "nor can the dark";
    f.brightness = 1;
    f.run(1);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    EXPECT_EQ(f.m.out.state.restarts, 0u);
}

TEST(SunLine, one_or_two_sensors_are_enough_to_go_on_and_not_to_be_good_from_the_start)
{
    for (std::uint64_t seed = 1; seed <= 50; seed++) {
        Flown f(seed, true);
        const auto only = [](unsigned n) {
            return [n](Flown &flown) {
                unsigned left = n;
                for (unsigned i = 0; i < 8; i++) {
                    const bool lit = flown.m.in.cosines.lit >> i & 1;
                    flown.m.in.cosines.lit &= left > 0 || !lit ? 0xFFu : ~(1u << i);
                    left -= lit && left > 0;
                }
            };
        };
        f.fault = only(1);
        f.update();
        EXPECT_LE(f.quality(), QUALITY_DEGRADED);
        EXPECT_TRUE(f.quality() == QUALITY_NONE || f.m.out.state.std > 0.5) << "all that it knows is a cone";
        Flown g(seed, true);
        g.fault = only(2);
        g.update();
        EXPECT_LE(g.quality(), QUALITY_DEGRADED);
        g.fault = nullptr;
        g.run(10);
        g.fault = only(1);
        g.run(60);
        EXPECT_EQ(g.quality(), QUALITY_GOOD) << "the body turns, so that one sensor sees both axes in time";
        EXPECT_LT(g.error(), 0.05);
    }
}

TEST(SunLine, in_the_dark_the_rates_carry_it_on_until_it_is_given_up)
{
    Flown f(3, true);
    f.run(60);
    f.brightness = 0;
    f.run(100);
    EXPECT_NE(f.quality(), QUALITY_NONE);
    EXPECT_LT(f.error(), 5 * f.m.out.state.std);
    f.brightness = 1;
    f.run(2);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
    EXPECT_EQ(f.m.out.state.restarts, 0u);

    Flown without(4, false);
    without.run(60);
    without.brightness = 0;
    without.run(600);
    EXPECT_EQ(without.quality(), QUALITY_DEGRADED);
    const auto held = without.m.out.heading.head;
    without.run(10);
    EXPECT_EQ(without.m.out.heading.head.sequence, held.sequence);
    without.brightness = 1;
    without.run(20);
    EXPECT_EQ(without.quality(), QUALITY_GOOD);
    EXPECT_LT(without.error(), 0.05);
}

TEST(SunLine, a_stuck_sensor_is_left_out)
{
    for (const double stuck : {1.0, 0.5, 3.0}) {
        Flown f(5, true);
        f.run(20);
        f.fault = [&](Flown &flown) {
            flown.m.in.cosines.cosine[6] = stuck;
            flown.m.in.cosines.lit |= 1u << 6;
        };
        f.run(60);
        EXPECT_LT(f.error(), 0.05) << stuck;
        EXPECT_GT(f.m.out.state.rejected, 100u);
        EXPECT_EQ(f.m.out.state.restarts, 0u);
    }
}

TEST(SunLine, it_leaves_a_direction_that_is_wrong)
{
    Flown f(6, true);
    f.run(20);
    f.s = -f.s;
    f.run(3);
    EXPECT_EQ(f.m.out.state.restarts, 1u);
    EXPECT_LT(f.error(), 0.05);
}

TEST(SunLine, without_rates_for_long_it_is_held)
{
    Flown f(7, true);
    f.run(20);
    f.fault = [](Flown &flown) { flown.m.in.gyro.head.quality = QUALITY_STALE; };
    f.run(1);
    EXPECT_EQ(f.quality(), QUALITY_DEGRADED);
    f.run(5);
    const auto held = f.m.out.heading.head;
    f.run(1);
    EXPECT_EQ(f.m.out.heading.head.sequence, held.sequence);
    f.fault = nullptr;
    f.run(5);
    EXPECT_EQ(f.quality(), QUALITY_GOOD);
}

TEST(SunLine, two_lit_sensors_have_the_direction_of_a_guess)
{
    int far = 0;
    for (std::uint64_t seed = 0; seed < 200; seed++) {
        double error[2];
        for (const int guessed : {0, 1}) {
            Flown f(seed, true);
            f.m.par.noise = 1e-3, f.m.par.good = 0.05; // a guess alone is neither known nor good
            f.fault = [guessed](Flown &flown) {
                std::uint32_t &lit = flown.m.in.cosines.lit;
                const std::uint32_t others = lit & (lit - 1);
                lit = (lit & ~others) | (others & ~(others - 1));
                const Vector3d guess = flown.s + 0.02 * flown.random.normals();
                flown.m.in.guess = {guessed ? good(flown.t) : Head{}, vec(Vector3d(guess.normalized()))};
            };
            f.run(20);
            EXPECT_EQ(f.quality(), QUALITY_DEGRADED) << seed;
            error[guessed] = f.error();
        }
        EXPECT_LT(error[1], 0.1) << seed;
        far += error[0] > 0.3 ? 1 : 0;
    }
    EXPECT_GT(far, 50);
}

TEST(SunLine, a_guess_from_long_ago_is_none)
{
    Flown f(3, true), without(3, true);
    f.m.in.guess = {{0, QUALITY_DEGRADED, 1}, vec(Vector3d(-f.s))};
    f.fault = without.fault = [](Flown &flown) { flown.m.in.cosines.lit &= flown.t < 4'000'000'000 ? 0U : ~0U; };
    f.run(5);
    without.run(5);
    EXPECT_EQ(eigen(f.m.out.heading.s_B), eigen(without.m.out.heading.s_B));
}

TEST(SunLine, in_the_dark_the_gyro_gives_the_rate)
{
    Flown f(4, true);
    f.fault = [](Flown &flown) { flown.m.in.cosines.lit = 0; };
    f.run(2);
    EXPECT_EQ(f.m.out.heading.head.quality, QUALITY_NONE);
    EXPECT_EQ(f.m.out.rate.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(eigen(f.m.out.rate.omega_BN_B), eigen(f.m.in.gyro.omega_BN_B));
    const auto last = f.m.out.rate.head;
    f.fault = [](Flown &flown) { flown.m.in.cosines.lit = 0, flown.m.in.gyro.head.quality = QUALITY_STALE; };
    f.run(2);
    EXPECT_EQ(f.m.out.rate.head.sequence, last.sequence);
    f.fault = [](Flown &flown) { flown.m.in.cosines.lit = 0, flown.m.in.gyro.head = {0, QUALITY_DEGRADED, 1}; };
    f.run(2);
    EXPECT_EQ(f.m.out.rate.head.sequence, last.sequence) << "old rates are none";
}

TEST(SunLine, old_cosines_begin_nothing)
{
    Flown f(9, false);
    f.run(1);
    const std::int64_t last = f.m.in.cosines.head.t;
    f.fault = [&](Flown &flown) { flown.m.in.cosines.head = {last, QUALITY_DEGRADED, 5}; };
    f.run(600); // until the direction is given up
    const auto held = f.m.out.heading.head;
    f.run(60);
    EXPECT_EQ(f.m.out.heading.head.sequence, held.sequence);
    EXPECT_LE(f.m.out.state.restarts, 1u);
}

TEST(SunLine, bad_numbers_leave_it_sound)
{
    for (const double bad : {std::nan(""), HUGE_VAL, 1e160, 1e308}) {
        Flown f(8, true);
        f.run(20);
        f.fault = [&](Flown &flown) {
            flown.m.in.cosines.cosine[2] = bad;
            flown.m.in.cosines.axes_B[3].v[1] = bad;
            flown.m.in.cosines.weight[1] = bad;
            flown.m.in.gyro.omega_BN_B.v[0] = bad;
        };
        f.run(1);
        f.fault = nullptr;
        for (unsigned i = 0; i < 8; i++) {
            f.m.in.cosines.axes_B[i] = vec_unit(vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
            f.m.in.cosines.weight[i] = 1;
        }
        f.run(5);
        EXPECT_LT(f.error(), 0.05) << bad;
        EXPECT_EQ(f.quality(), QUALITY_GOOD) << bad;
    }
}

} // namespace sun_line_test
} // namespace flight::testing

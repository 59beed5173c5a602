// SPDX-License-Identifier: Apache-2.0
// A body that turns, with eight coarse sun sensors along the corners of a cube, with and without a gyro.
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/sensing/sun_line.h"
}

#include <gtest/gtest.h>

#include <functional>

namespace flight::testing {
namespace {

constexpr std::int64_t step_ns = 200'000'000;
constexpr double step = 0.2;

double normal(Random &random)
{
    return std::sqrt(-2 * std::log(1 - random.real(0, 1))) * std::cos(2 * pi * random.real(0, 1));
}

Vector3d normals(Random &random)
{
    const double x = normal(random), y = normal(random), z = normal(random);
    return {x, y, z};
}

struct Flown {
    SunLine m{};
    Random random;
    bool gyro;
    Vector3d s, omega, bias;
    std::int64_t t = 0;
    double brightness = 1;
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
        omega = gyro ? Vector3d(0.05 * random.direction()) : Vector3d(0.02 * normals(random));
        bias = 1e-3 * normals(random);
        sun_line_reset(&m);
        SunCosines &cosines = m.in.cosines;
        cosines.n = 8;
        for (unsigned i = 0; i < 8; i++) {
            cosines.axes_B[i] = vec_unit(vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
            cosines.weight[i] = i < 4 ? 1 : 0.25;
        }
    }

    void update()
    {
        if (t > 0) {
            if (!gyro) {
                omega += std::sqrt(1e-8 * step) * normals(random);
            }
            s = turn(omega, omega.norm() * step) * s;
            bias += std::sqrt(1e-14 * step) * normals(random);
        }
        SunCosines &cosines = m.in.cosines;
        cosines.head = good(t);
        cosines.lit = 0;
        for (unsigned i = 0; i < 8; i++) {
            const double cosine = brightness * eigen(cosines.axes_B[i]).dot(s);
            cosines.cosine[i] = std::max(0.0, cosine) + 0.01 / std::sqrt(cosines.weight[i]) * normal(random);
            cosines.lit |= cosine > 0.1 ? 1u << i : 0;
        }
        if (gyro) {
            m.in.gyro = {good(t), vec(omega + bias + std::sqrt(1e-8 / step) * normals(random))};
        }
        if (fault) {
            fault(*this);
        }
        sun_line_update(&m, {t, t ? step_ns : 0});
        t += step_ns;
    }
    void run(double seconds)
    {
        for (int i = 0; i < std::lround(seconds / step); i++) {
            update();
        }
    }

    double error() const { return (eigen(m.out.heading.s_B) - s).norm(); }
    Quality quality() const { return m.out.heading.head.quality; }
};

TEST(SunLine, its_errors_are_as_large_as_it_says)
{
    // Direction and rate across it, four numbers; averages over 200 runs within 99.8 % of chi-square.
    for (const bool gyro : {true, false}) {
        double sum = 0;
        for (std::uint64_t seed = 1; seed <= 200; seed++) {
            Flown f(seed, gyro);
            f.run(40);
            Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> root(&f.m.mem.root[0][0]);
            const Vector3d a = f.s.unitOrthogonal(), b = f.s.cross(a);
            Eigen::Matrix<double, 4, 6> to = Eigen::Matrix<double, 4, 6>::Zero();
            to.topLeftCorner<1, 3>() = to.block<1, 3>(2, 3) = a.transpose();
            to.block<1, 3>(1, 0) = to.bottomRightCorner<1, 3>() = b.transpose();
            Eigen::Matrix<double, 6, 1> error;
            error << f.s - eigen(f.m.mem.d_B), (gyro ? Vector3d(-f.bias) : f.omega) - eigen(f.m.mem.b_B);
            const Eigen::Matrix4d P = to * root.transpose() * root * to.transpose();
            sum += (to * error).dot(P.ldlt().solve(to * error)) / 200;
            EXPECT_LT(f.error(), 5 * f.m.out.state.std);
            EXPECT_EQ(f.quality(), QUALITY_GOOD);
        }
        EXPECT_GT(sum, 3.40) << gyro;
        EXPECT_LT(sum, 4.65) << gyro;
    }
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

} // namespace
} // namespace flight::testing

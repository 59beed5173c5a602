// SPDX-License-Identifier: Apache-2.0
// Wanted speeds have the momentum of the wheels, no other null motion does better, and wheels stay out of the band.
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/wheel_balance.h"
#include "flight/actuation/wheel_speed_plan.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace wheel_speed_plan_test {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;
constexpr std::int64_t second = 1'000'000'000;
constexpr double low = 30, high = 600, margin = 15; // rad/s

WheelSpeedPlan plan_of(const Matrix3Xd &axes, double J)
{
    WheelSpeedPlan m{};
    m.in.wheels.head = m.in.speeds.head = good();
    m.in.wheels.n = static_cast<std::uint32_t>(axes.cols());
    for (int i = 0; i < axes.cols(); i++) {
        m.in.wheels.axes_B[i] = vec(axes.col(i));
        m.in.wheels.J[i] = J;
    }
    m.par = {low, high, margin};
    return m;
}

WheelSpeedPlan any(Random &random, int n)
{
    Matrix3Xd axes(3, n);
    for (int i = 0; i < n; i++) {
        axes.col(i) = random.direction();
    }
    WheelSpeedPlan m = plan_of(axes, 1);
    const double fastest = random.below(3) ? 200 : 900;
    for (int i = 0; i < n; i++) {
        m.in.wheels.J[i] = random.real(1e-5, 3e-5);
        m.in.speeds.Omega[i] = random.real(-fastest, fastest);
    }
    return m;
}

VectorXd numbers(const double *at, const WheelSpeedPlan &m)
{
    return Eigen::Map<const VectorXd>(at, static_cast<int>(m.in.wheels.n));
}

/// Columns J_i g_i.
Matrix3Xd to_momentum(const WheelSpeedPlan &m)
{
    Matrix3Xd A(3, m.in.wheels.n);
    for (int i = 0; i < A.cols(); i++) {
        A.col(i) = m.in.wheels.J[i] * eigen(m.in.wheels.axes_B[i]);
    }
    return A;
}

Matrix3Xd pyramid()
{
    Matrix3Xd axes(3, 4);
    axes << 1, 0, -1, 0, 0, 1, 0, -1, 1, 1, 1, 1;
    return axes / std::sqrt(2.0);
}

TEST(WheelSpeedPlan, wanted_speeds_have_the_momentum_of_now)
{
    Random random{1};
    for (int i = 0; i < 2000; i++) {
        WheelSpeedPlan m = any(random, 1 + i % 8);
        wheel_speed_plan_update(&m, {0, 0});
        const VectorXd now = numbers(m.in.speeds.Omega, m), wanted = numbers(m.out.wanted.Omega, m);
        const Matrix3Xd A = to_momentum(m);
        EXPECT_LT((A * (wanted - now)).norm(), 1e-13 * (A * now).norm() + 1e-13 * A.norm() * wanted.norm());
        EXPECT_EQ(m.out.wanted.head.quality, QUALITY_GOOD);
        EXPECT_EQ(m.out.state.phase == WHEEL_PLAN_NONE, i % 8 < 3);
        if (i % 8 < 3) {
            EXPECT_EQ(wanted, now) << "there is no null motion to ask for";
        }
    }
}

TEST(WheelSpeedPlan, axes_that_only_nearly_lie_in_a_plane_have_no_null_motion)
{
    Matrix3Xd axes(3, 4);
    axes << 1, 1, 1, 0, 0, 0, 0, 1, 0, 1e-5, 0, 0; // the last wheel has no part in it
    WheelSpeedPlan m = plan_of(axes.colwise().normalized(), 2e-5);
    const VectorXd now = VectorXd::LinSpaced(4, 10, 40);
    VectorXd::Map(m.in.speeds.Omega, 4) = now;
    wheel_speed_plan_update(&m, {0, 0});
    EXPECT_EQ(m.out.wanted.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.state.phase, WHEEL_PLAN_NONE);
    EXPECT_EQ(numbers(m.out.wanted.Omega, m), now);
}

/// Overload, wheels in the band, whether a sign differs, and the depth in the wider band.
std::tuple<double, int, bool, double> cost(const VectorXd &Omega, const VectorXd &signs)
{
    const VectorXd size = Omega.cwiseAbs();
    return {std::max(0.0, size.maxCoeff() / high - 1), static_cast<int>((size.array() < low * (1 - 1e-9)).count()),
            (Omega.array() * signs.array() < 0).any(), std::max(0.0, low + margin - size.minCoeff())};
}

TEST(WheelSpeedPlan, of_four_wheels_no_null_motion_is_better)
{
    Random random{2};
    int phases[4] = {};
    const int n = runs(400);
    for (int i = 0; i < n; i++) {
        WheelSpeedPlan m = any(random, 4);
        wheel_speed_plan_update(&m, {0, 0});
        const VectorXd now = numbers(m.in.speeds.Omega, m), wanted = numbers(m.out.wanted.Omega, m);
        const Matrix3Xd A = to_momentum(m);
        VectorXd z = VectorXd::Unit(4, 0), least; // the null space, as what a fit of a unit vector leaves
        for (int k = 0; k < 4; k++) {
            const VectorXd e = VectorXd::Unit(4, k), rest = e - least_squares(A, A * e);
            z = k == 0 || rest.norm() > z.norm() ? rest : z;
        }
        z.normalize();
        const auto mine = cost(wanted, now);
        const VectorXd J = numbers(m.in.wheels.J, m);
        const auto energy = [&](const VectorXd &Omega) { return (J.array() * Omega.array().square()).sum(); };
        for (int k = -4000; k <= 4000; k++) {
            const VectorXd other = now + k * 0.5 * z;
            const auto theirs = cost(other, now);
            const bool tie = std::get<0>(mine) <= std::get<0>(theirs) + 1e-9 &&
                             std::get<1>(mine) == std::get<1>(theirs) && std::get<2>(mine) == std::get<2>(theirs) &&
                             std::get<3>(mine) <= std::get<3>(theirs) + 1e-6;
            ASSERT_TRUE(mine < theirs || tie || std::abs(std::get<0>(mine) - std::get<0>(theirs)) < 1e-9) << i;
            if (mine == theirs && std::get<0>(mine) == 0) {
                ASSERT_LE(energy(wanted), energy(other) * (1 + 1e-9)) << i;
            }
        }
        phases[m.out.state.phase]++;
    }
    EXPECT_GT(phases[WHEEL_PLAN_HOLDS], n / 10);
    EXPECT_GT(phases[WHEEL_PLAN_CROSSES], n / 20);
    EXPECT_GT(phases[WHEEL_PLAN_BOUND], n / 20);
}

TEST(WheelSpeedPlan, state_counts_wheels_and_says_how_far_the_largest_speed_is)
{
    WheelSpeedPlan m = plan_of(pyramid(), 2e-5);
    const double speeds[4] = {20, -100, 300, -29};
    std::copy(speeds, speeds + 4, m.in.speeds.Omega);
    wheel_speed_plan_update(&m, {0, 0});
    EXPECT_NEAR(m.out.state.margin, 0.5, 1e-15);
    EXPECT_EQ(m.out.state.in_band, 2u);
    EXPECT_EQ(m.out.state.phase, WHEEL_PLAN_HOLDS);
    EXPECT_NEAR(m.out.state.margin_wanted, 1 - 325 / high, 1e-12) << "(+ - + -), the slowest at 45, the fastest at 325";
    EXPECT_EQ(m.out.state.crossings, 0u);
    m.in.availability = {good(), {1, 1, 0, 1}};
    m.in.speeds.Omega[2] = std::nan("");
    wheel_speed_plan_update(&m, {second, second});
    EXPECT_EQ(m.out.state.phase, WHEEL_PLAN_NONE) << "three are left";
    EXPECT_EQ(m.out.state.head.quality, QUALITY_GOOD);
    EXPECT_EQ(numbers(m.out.wanted.Omega, m), Eigen::Vector4d(20, -100, 0, -29));
    EXPECT_EQ(m.out.state.in_band, 2u);
    EXPECT_NEAR(m.out.state.margin, 1 - 100 / high, 1e-15);
}

struct Turning {
    double dwell = 0, fastest = 0, longest = 0, torque_error = 0;
    int crossings = 0;
};

/// The wheels take up a momentum that turns, as in a body that keeps to nadir: two orbits.
Turning turn_momentum(WheelSpeedPlan plan, double h, bool planned, double noise)
{
    Random random{7};
    const double J = plan.in.wheels.J[0], dt = 0.5;
    WheelBalance balance{};
    balance.in.wheels = plan.in.wheels;
    balance.in.torques.head = balance.in.speeds.head = good();
    balance.par.K = 0.5 * J;
    const auto n = static_cast<int>(plan.in.wheels.n);
    std::fill(balance.in.wheels.u_max, balance.in.wheels.u_max + 8, 1e-3);
    const Matrix3Xd G = to_momentum(plan) / J;
    const auto momentum = [&](double t) -> Vector3d {
        const double a = 2 * pi * t / 5677;
        return h * Vector3d(std::cos(a), 0.7 * std::sin(a), 0.3 * std::cos(2 * a + 1));
    };
    VectorXd Omega = least_squares(G, momentum(0) / J);
    Turning result;
    std::vector<double> dwelt(static_cast<std::size_t>(n), 0.0);
    for (int k = 0; k < 2 * 5677 * 2; k++) {
        const double t = k * dt;
        for (int i = 0; i < n; i++) {
            plan.in.speeds.Omega[i] = balance.in.speeds.Omega[i] = Omega[i] + random.real(-noise, noise);
        }
        wheel_speed_plan_update(&plan, {static_cast<std::int64_t>(t * 1e9), k ? second / 2 : 0});
        const VectorXd u = least_squares(G, (momentum(t + dt) - momentum(t)) / dt);
        std::copy(u.data(), u.data() + n, balance.in.torques.u);
        if (planned) {
            balance.in.wanted = plan.out.wanted;
        }
        wheel_balance_update(&balance, {static_cast<std::int64_t>(t * 1e9), k ? second / 2 : 0});
        Omega += Eigen::Map<const VectorXd>(balance.out.command.u, n) * dt / J;
        result.torque_error = std::max(result.torque_error, (J * G * Omega - momentum(t + dt)).norm() / h);
        if (t > 120) { // after the start
            for (std::size_t i = 0; i < dwelt.size(); i++) {
                const double size = std::abs(Omega[static_cast<int>(i)]);
                dwelt[i] = size < low ? dwelt[i] + dt : 0;
                result.dwell += size < low ? dt : 0;
                result.longest = std::max(result.longest, dwelt[i]);
                result.fastest = std::max(result.fastest, size);
            }
        }
    }
    result.crossings = static_cast<int>(plan.out.state.crossings);
    return result;
}

TEST(WheelSpeedPlan, wheels_do_not_dwell_in_the_band_while_the_momentum_turns)
{
    for (const double h : {1e-3, 4e-3, 8e-3}) {
        const WheelSpeedPlan m = plan_of(pyramid(), 1.6e-5);
        const Turning without = turn_momentum(m, h, false, 0), with_plan = turn_momentum(m, h, true, 0.5);
        EXPECT_LE(with_plan.longest, 2 * std::log(1 + 2 * low / margin) + 0.5) << "through zero quickly";
        EXPECT_GT(without.dwell, 1000);
        EXPECT_LT(with_plan.dwell, 0.04 * without.dwell);
        EXPECT_LT(with_plan.fastest, high);
        EXPECT_LT(with_plan.torque_error, 1e-9) << "the momentum is that of the torque alone";
    }
}

TEST(WheelSpeedPlan, without_sound_numbers_the_plan_is_held)
{
    Random random{4};
    WheelSpeedPlan m = any(random, 5);
    wheel_speed_plan_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.wheels.axes_B[3], m.in.wheels.J[2], m.in.speeds.Omega[4], m.par.Omega_min, m.par.margin),
        [](WheelSpeedPlan &x) {
            wheel_speed_plan_update(&x, {second, second});
        },
        [](WheelSpeedPlan &x) {
            return std::vector{&x.out.wanted.head, &x.out.state.head};
        });
    WheelSpeedPlan bad = m;
    bad.in.wheels.J[1] = -1e-5;
    wheel_speed_plan_update(&bad, {second, second});
    EXPECT_TRUE(same_content(bad.out.wanted, m.out.wanted));
    EXPECT_EQ(bad.out.wanted.head.quality, QUALITY_DEGRADED);
    bad = m;
    bad.in.speeds.head.quality = QUALITY_STALE;
    wheel_speed_plan_update(&bad, {second, second});
    EXPECT_EQ(bad.out.wanted.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(bad.out.wanted.head.sequence, 2u);
    wheel_speed_plan_reset(&m);
    m.in.speeds.head = {};
    wheel_speed_plan_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out));
}

TEST(WheelSpeedPlan, gives_finite_numbers_whatever_it_is_given)
{
    Random random{5};
    WheelSpeedPlan m{};
    const Doubles in = doubles(m.in.wheels.axes_B, m.in.wheels.J, m.in.speeds.Omega, m.par);
    for (int round = 0; round < 20000; round++) {
        throw_numbers(in, random, round);
        m.in.wheels.n = static_cast<std::uint32_t>(random.below(12)) - (round % 5 == 0 ? 2 : 0);
        m.in.wheels.head.quality = any_quality(random);
        m.in.speeds.head.quality = any_quality(random);
        m.in.availability.head.quality = any_quality(random);
        m.in.availability.available[random.below(8)] ^= 1;
        wheel_speed_plan_update(&m, {round * second, second});
        expect_finite(doubles(m.out.wanted.Omega, m.out.state.margin, m.out.state.margin_wanted), round);
    }
}

} // namespace wheel_speed_plan_test
} // namespace flight::testing

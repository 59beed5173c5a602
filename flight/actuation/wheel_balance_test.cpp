// SPDX-License-Identifier: Apache-2.0
// Null motion: no torque on the body, and speeds that go where they may.
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/wheel_balance.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace wheel_balance_test {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;
constexpr std::int64_t second = 1'000'000'000;

WheelBalance any(Random &random, int n)
{
    WheelBalance m{};
    m.in.torques.head = m.in.wheels.head = m.in.speeds.head = good();
    m.in.wheels.n = static_cast<std::uint32_t>(n);
    for (int i = 0; i < n; i++) {
        m.in.torques.u[i] = random.real(-0.1, 0.1);
        m.in.wheels.axes_B[i] = vec(random.direction());
        m.in.wheels.J[i] = random.real(0.01, 0.2);
        m.in.speeds.Omega[i] = random.real(-300, 300);
        m.par.Omega[i] = random.real(-100, 100);
    }
    m.par.K = 0.01;
    return m;
}

VectorXd numbers(const double *at, const WheelBalance &m)
{
    return Eigen::Map<const VectorXd>(at, static_cast<int>(m.in.wheels.n));
}

Matrix3Xd axes(const WheelBalance &m)
{
    Matrix3Xd G(3, m.in.wheels.n);
    for (int i = 0; i < G.cols(); i++) {
        G.col(i) = eigen(m.in.wheels.axes_B[i]);
    }
    return G;
}

TEST(WheelBalance, gives_no_torque_and_moves_towards_the_wanted_speeds)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        WheelBalance m = any(random, 1 + i % 8);
        m.in.availability.head = i % 3 ? Head{} : good();
        for (auto &may : m.in.availability.available) {
            may = random.below(4) > 0;
        }
        const Matrix3Xd G = axes(m);
        wheel_balance_update(&m, {0, 0});
        const VectorXd null = numbers(m.out.command.u, m) - numbers(m.in.torques.u, m);
        const VectorXd error = numbers(m.in.speeds.Omega, m) - numbers(m.par.Omega, m);
        EXPECT_LT((G * null).norm(), 1e-10);
        EXPECT_LT(error.dot(null), 1e-12 * error.squaredNorm()) << "sum J d(error^2)/dt / 2";
        for (int k = 0; k < null.size() && i % 3 == 0; k++) {
            EXPECT_TRUE(m.in.availability.available[k] || null[k] == 0.0);
        }
        if (m.in.wheels.n <= 3 && i % 3) {
            EXPECT_LT(null.norm(), 1e-5) << "three wheels have no null motion";
        }
        EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
    }
}

TEST(WheelBalance, ends_at_the_distribution_of_least_squares)
{
    Random random{2};
    for (int i = 0; i < 10; i++) {
        WheelBalance m = any(random, 4);
        std::fill(m.par.Omega, m.par.Omega + 8, 0.0);
        std::fill(m.in.wheels.J, m.in.wheels.J + 8, 0.1);
        std::fill(m.in.torques.u, m.in.torques.u + 8, 0.0);
        const Matrix3Xd G = axes(m);
        const Vector3d h = 0.1 * G * numbers(m.in.speeds.Omega, m);
        for (int k = 0; k < 1000; k++) {
            wheel_balance_update(&m, {k * second, k ? second : 0});
            for (int w = 0; w < 4; w++) {
                m.in.speeds.Omega[w] += m.out.command.u[w] / 0.1;
            }
        }
        const VectorXd least = least_squares(G, h / 0.1);
        EXPECT_LT((numbers(m.in.speeds.Omega, m) - least).norm(), 1e-9 * least.norm());
    }
}

TEST(WheelBalance, leaves_the_commanded_torque_whole_at_a_limit)
{
    Random random{3};
    int limited = 0;
    for (int i = 0; i < 300; i++) {
        WheelBalance m = any(random, 5);
        m.par.K = 1;
        std::fill(m.in.wheels.u_max, m.in.wheels.u_max + 8, 0.2);
        wheel_balance_update(&m, {0, 0});
        const VectorXd u = numbers(m.out.command.u, m);
        EXPECT_LT(u.cwiseAbs().maxCoeff(), 0.2 + 1e-12);
        EXPECT_LT((axes(m) * (u - numbers(m.in.torques.u, m))).norm(), 1e-12);
        limited += u.cwiseAbs().maxCoeff() > 0.2 - 1e-9;
    }
    EXPECT_GT(limited, 250);
}

TEST(WheelBalance, wanted_speeds_that_are_no_longer_written_do_not_count)
{
    Random random{5};
    WheelBalance m = any(random, 4);
    m.par.hold = 2;
    m.in.wanted.head = good();
    wheel_balance_update(&m, {5 * second, second});
    EXPECT_NE(numbers(m.out.command.u, m), numbers(m.in.torques.u, m));
    m.in.wanted.head = {3 * second, QUALITY_STALE, 1};
    wheel_balance_update(&m, {5 * second, second});
    EXPECT_NE(numbers(m.out.command.u, m), numbers(m.in.torques.u, m)) << "within the hold";
    wheel_balance_update(&m, {6 * second, second});
    EXPECT_EQ(numbers(m.out.command.u, m), numbers(m.in.torques.u, m));
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
}

TEST(WheelBalance, without_new_speeds_the_command_passes_unchanged)
{
    Random random{4};
    WheelBalance m = any(random, 4);
    m.par.hold = 2;
    m.in.speeds.head = with(QUALITY_DEGRADED);
    for (int k = 0; k < 5; k++) {
        wheel_balance_update(&m, {k * second, k ? second : 0});
        EXPECT_EQ(numbers(m.out.command.u, m) == numbers(m.in.torques.u, m), k > 2);
        EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    }
    m.in.torques.head = {second, QUALITY_DEGRADED, 3};
    wheel_balance_update(&m, {6 * second, second});
    EXPECT_EQ(m.out.command.head.t, second) << "its age can be seen";
    m.in.wanted.head = good();
    m.in.speeds.head = good();
    m.in.torques.head = good();
    wheel_balance_update(&m, {7 * second, second});
    expect_held(
        m, doubles(m.in.torques.u[0]),
        [](WheelBalance &x) {
            wheel_balance_update(&x, {8 * second, second});
        },
        [](WheelBalance &x) { return std::vector{&x.out.command.head}; });
    const WheelBalance sound = m;
    for (double *input : doubles(m.in.wheels.axes_B[3], m.in.speeds.Omega[2], m.in.wanted.Omega[1])) {
        for (const double bad : {HUGE_VAL, std::numeric_limits<double>::quiet_NaN()}) {
            *input = bad;
            wheel_balance_update(&m, {8 * second, second});
            EXPECT_EQ(numbers(m.out.command.u, m), numbers(m.in.torques.u, m)) << "a torque is not held for ever";
            EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
            m = sound;
        }
    }
}

} // namespace wheel_balance_test
} // namespace flight::testing

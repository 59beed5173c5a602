// SPDX-License-Identifier: Apache-2.0
// Rates of gimbals: their wheels' momentum changes as the wanted torque says, away from singularities.
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/gimbal_steering.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace gimbal_steering_test {

constexpr std::int64_t second = 1'000'000'000;
constexpr double H = 6;

GimbalSteering any(Random &random, std::uint32_t n, double rate_max = 1e9)
{
    GimbalSteering m{};
    m.in.torque = {good(), vec(random.vector(3))};
    m.in.rate.head = m.in.gimbals.head = good();
    m.in.rate.omega_BN_B = vec(random.vector(0.1));
    m.par.n = n;
    m.par.H = H;
    m.par.rate_max = rate_max;
    for (std::uint32_t i = 0; i < n; i++) {
        const Vector3d axis = random.direction();
        m.par.axes_B[i] = vec(axis * random.real(0.1, 3));
        m.par.spins_B[i] = vec(axis.cross(random.direction()));
        m.in.gimbals.angle[i] = random.real(-4, 4);
    }
    return m;
}

/// The momentum of the wheels at angles of the gimbals.
Vector3d momentum(const GimbalSteering &m, double dt = 0)
{
    Vector3d h = Vector3d::Zero();
    for (std::uint32_t i = 0; i < m.par.n; i++) {
        const double angle = m.in.gimbals.angle[i] + dt * m.out.rates.rate[i];
        h += H * (Eigen::AngleAxisd(angle, eigen(m.par.axes_B[i]).normalized()) * eigen(m.par.spins_B[i]).normalized());
    }
    return h;
}

/// The torque on the body: what the wheels lose, by a numerical derivative.
Vector3d given(const GimbalSteering &m)
{
    constexpr double dt = 1e-5;
    return -(momentum(m, dt) - momentum(m, -dt)) / (2 * dt) - eigen(m.in.rate.omega_BN_B).cross(momentum(m));
}

TEST(GimbalSteering, the_body_gets_the_wanted_torque)
{
    Random random{1};
    int far = 0;
    for (int i = 0; i < 1000; i++) {
        GimbalSteering m = any(random, static_cast<std::uint32_t>(3 + i % 6));
        gimbal_steering_update(&m, {0, 0});
        Eigen::Matrix3Xd A(3, m.par.n);
        for (std::uint32_t k = 0; k < m.par.n; k++) {
            GimbalSteering unit = m;
            std::fill(unit.out.rates.rate, unit.out.rates.rate + WHEELS_MAX, 0.0);
            unit.out.rates.rate[k] = 1;
            A.col(k) = (momentum(unit, 1e-5) - momentum(unit, -1e-5)) / (2e-5 * H);
        }
        const double det = Matrix3d(A.lazyProduct(A.transpose())).determinant(), lambda = 0.01 * std::exp(-10 * det);
        EXPECT_EQ(m.out.rates.head.quality, lambda > 0.005 ? QUALITY_DEGRADED : QUALITY_GOOD);
        const Vector3d error = given(m) - eigen(m.in.torque.torque_B);
        if (det > 2) {
            far++;
            EXPECT_LT(error.norm(), 1e-6);
        }
        const Eigen::Map<Eigen::VectorXd> rates(m.out.rates.rate, m.par.n);
        EXPECT_LT((rates - least_squares(A, A * rates)).norm(), 1e-6) << "no part of the rates is idle";
        EXPECT_LT(rates.norm(), 11 * (error.norm() + eigen(m.in.torque.torque_B).norm()) / H + 5) << "at a singularity";
    }
    EXPECT_GT(far, 200);
}

TEST(GimbalSteering, gyros_in_one_plane_give_what_they_can)
{
    Random random{2};
    GimbalSteering m = any(random, 4);
    for (std::uint32_t i = 0; i < 4; i++) { // all wheels may turn in the plane of b1 and b2 alone
        m.par.axes_B[i] = vec3(0, 0, 1);
        m.par.spins_B[i] = vec3(i < 2, i >= 2, 0);
        m.in.gimbals.angle[i] = 0.1 * i;
    }
    m.in.rate.omega_BN_B = vec3(0, 0, 0);
    m.in.torque.torque_B = vec3(1, 2, 3);
    gimbal_steering_update(&m, {0, 0});
    EXPECT_EQ(m.out.rates.head.quality, QUALITY_DEGRADED);
    EXPECT_LT((given(m) - Vector3d(1, 2, 0)).norm(), 0.05);
}

TEST(GimbalSteering, a_limit_slows_all_alike)
{
    Random random{3};
    for (int i = 0; i < 100; i++) {
        GimbalSteering m = any(random, 4, 0.1), free = m;
        free.par.rate_max = 1e9;
        gimbal_steering_update(&m, {0, 0});
        gimbal_steering_update(&free, {0, 0});
        const Eigen::Map<Eigen::Vector4d> a(m.out.rates.rate), b(free.out.rates.rate);
        EXPECT_LT((a - b * std::min(1.0, 0.1 / b.cwiseAbs().maxCoeff())).norm(), 1e-12);
        EXPECT_EQ(m.mem.saturated, b.cwiseAbs().maxCoeff() > 0.1);
    }
}

TEST(GimbalSteering, bad_numbers_change_no_rate)
{
    Random random{4};
    GimbalSteering m = any(random, 8);
    gimbal_steering_update(&m, {0, second});
    ASSERT_EQ(m.out.rates.head.quality, QUALITY_GOOD);
    const Doubles inputs = doubles(m.in.torque.torque_B, m.in.rate.omega_BN_B, m.in.gimbals.angle);
    const auto update = [](GimbalSteering &module) { gimbal_steering_update(&module, {second, second}); };
    expect_held(m, inputs, update, [](GimbalSteering &module) { return std::vector{&module.out.rates.head}; });
}

TEST(GimbalSteering, the_rates_end_without_new_data)
{
    Random random{5};
    GimbalSteering m = any(random, 4);
    m.par.hold = 3;
    gimbal_steering_update(&m, {0, 0});
    m.in.torque.head.quality = QUALITY_NONE;
    for (int k = 1; k < 8; k++) {
        gimbal_steering_update(&m, {k * second, second});
        EXPECT_EQ(m.out.rates.rate[0] != 0, k <= 3);
        EXPECT_EQ(m.out.rates.head.quality, QUALITY_DEGRADED);
    }
    gimbal_steering_reset(&m);
    EXPECT_FALSE(head_written(m.out.rates.head));
}

} // namespace gimbal_steering_test
} // namespace flight::testing

// SPDX-License-Identifier: Apache-2.0
// MRP steering: its limits, its derivative, and the Lyapunov function along the motion that it wants.
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/mrp_steering.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace mrp_steering_test {

MrpSteering any(Random &random)
{
    MrpSteering m{};
    m.in.error = {good(), random.mrp(), vec(random.vector(0.1)), vec(random.vector()), vec(random.vector())};
    m.par.K1 = random.real(0.01, 1);
    m.par.K3 = random.real(0, 1);
    m.par.omega_max = random.real(0.001, 0.1);
    return m;
}

RateCommand of(MrpSteering m, const Vector3d &sigma, const Vector3d &omega = Vector3d::Zero())
{
    m.in.error.sigma_BR = vec(sigma);
    m.in.error.omega_BR_B = vec(omega);
    mrp_steering_update(&m, {0, 0});
    return m.out.command;
}

TEST(MrpSteering, turns_against_the_error_and_within_the_limit)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        const MrpSteering m = any(random);
        const Vector3d sigma = eigen(m.in.error.sigma_BR), omega = eigen(of(m, sigma).omega_DR_B);
        for (int k = 0; k < 3; k++) {
            EXPECT_LT(std::abs(omega[k]), m.par.omega_max);
            EXPECT_LE(omega[k] * sigma[k], 0);
        }
        const double x = 1e-6;
        EXPECT_NEAR(of(m, {x, 0, 0}).omega_DR_B.v[0], -m.par.K1 * x, 1e-6 * m.par.K1 * x) << "linear near zero";
        EXPECT_GT(-of(m, {1e9, 0, 0}).omega_DR_B.v[0], 0.999999 * m.par.omega_max);
    }
}

TEST(MrpSteering, derivative_is_that_along_the_motion)
{
    Random random{2};
    for (int i = 0; i < 300; i++) {
        const MrpSteering m = any(random);
        const Vector3d sigma = eigen(m.in.error.sigma_BR), omega = eigen(m.in.error.omega_BR_B);
        const Vector3d dsigma = eigen(mrp_rate(vec(sigma), vec(omega)));
        const auto along = [&](double t) -> Vector3d { return eigen(of(m, sigma + t * dsigma).omega_DR_B); };
        EXPECT_LT((eigen(of(m, sigma, omega).domega_DR_B) - derivative<Vector3d>(along, 1e-3)).norm(), 1e-8);
    }
}

TEST(MrpSteering, lyapunov_function_falls_along_the_wanted_motion)
{
    Random random{3};
    for (int i = 0; i < 20; i++) {
        const MrpSteering m = any(random);
        Vector3d sigma = eigen(m.in.error.sigma_BR);
        const auto V = [&] { return 2 * std::log1p(sigma.squaredNorm()); };
        for (int k = 0; k < 500; k++) {
            const Vector3d omega = eigen(of(m, sigma).omega_DR_B);
            const Vector3d dsigma = eigen(mrp_rate(vec(sigma), vec(omega)));
            const double dV = 4 * sigma.dot(dsigma) / (1 + sigma.squaredNorm());
            EXPECT_NEAR(dV, sigma.dot(omega), 1e-15);
            ASSERT_LE(dV, 0);
            const double before = V();
            sigma += 0.2 / (m.par.K1 + m.par.K3) * dsigma;
            ASSERT_LE(V(), before);
        }
    }
}

TEST(MrpSteering, holds_its_command_without_an_error)
{
    Random random{4};
    MrpSteering m = any(random);
    mrp_steering_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.error.sigma_BR, m.in.error.omega_BR_B),
        [](MrpSteering &x) {
            mrp_steering_update(&x, {9, 9});
        },
        [](MrpSteering &x) { return std::vector{&x.out.command.head}; });
    m.in.error.head = with(QUALITY_STALE);
    mrp_steering_update(&m, {9, 9});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    mrp_steering_reset(&m);
    m.in.error.head = {};
    mrp_steering_update(&m, {9, 9});
    EXPECT_TRUE(all_zero(m.out));
}

} // namespace mrp_steering_test
} // namespace flight::testing

// SPDX-License-Identifier: Apache-2.0
// Sun-safe pointing: the turn that brings an axis to the Sun, in closed loop, and what happens in the dark.
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/sun_safe.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace sun_safe_test {

constexpr std::int64_t second = 1'000'000'000;

SunSafe any(Random &random)
{
    SunSafe m{};
    m.in.sun = {good(), vec(random.direction())};
    m.in.rate = {good(), vec(random.vector(0.1))};
    m.par.axis_B = vec(random.vector(3));
    m.par.search_B = vec3(0, 0.02, 0);
    return m;
}

TEST(SunSafe, the_reference_has_the_axis_at_the_sun_by_the_shortest_turn)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        SunSafe m = any(random);
        const Vector3d c = eigen(m.par.axis_B).normalized(), s = eigen(m.in.sun.s_B);
        sun_safe_update(&m, {0, 0});
        const AttError &error = m.out.error;
        EXPECT_LT((dcm(error.sigma_BR) * c - s).norm(), 1e-14) << "what is c in R is s in B";
        EXPECT_NEAR(4 * std::atan(vec_norm(error.sigma_BR)), std::acos(c.dot(s)), 1e-7);
        EXPECT_EQ(eigen(error.omega_BR_B), eigen(m.in.rate.omega_BN_B));
        EXPECT_EQ(error.head.quality, QUALITY_GOOD);

        m.in.sun.s_B = vec(-c); // opposite
        sun_safe_update(&m, {0, 0});
        EXPECT_LT((dcm(m.out.error.sigma_BR) * c + c).norm(), 1e-14);
        m.in.sun.s_B = vec(c);
        sun_safe_update(&m, {0, 0});
        EXPECT_LT(vec_norm(m.out.error.sigma_BR), 1e-12);
    }
}

TEST(SunSafe, with_a_control_it_ends_at_the_sun_and_spins_about_it)
{
    Random random{2};
    for (int run = 0; run < runs(10); run++) {
        SunSafe m = any(random);
        m.par.spin = 0.01;
        const Matrix3d I = random.spd(10), P = 0.15 * I + 5 * Matrix3d::Identity();
        const Vector3d s_N = random.direction();
        Vec3 sigma_BN = random.mrp();
        Vector3d omega = random.vector(0.02);
        for (int k = 0; k < 9000; k++) {
            m.in.sun.s_B = vec(dcm(sigma_BN) * s_N);
            m.in.rate.omega_BN_B = vec(omega);
            sun_safe_update(&m, {k * second / 10, second / 10});
            const Vector3d omega_BR = eigen(m.out.error.omega_BR_B), omega_RN = eigen(m.out.error.omega_RN_B);
            const Vector3d torque = -eigen(m.out.error.sigma_BR) - P * omega_BR - I * omega.cross(omega_RN);
            omega += 0.1 * solve(I, torque); // the gyroscopic torque is compensated
            sigma_BN = mrp_short(vec_add(sigma_BN, vec_scale(0.1, mrp_rate(sigma_BN, vec(omega)))));
        }
        const Vector3d s = dcm(sigma_BN) * s_N;
        EXPECT_LT((s - eigen(m.par.axis_B).normalized()).norm(), 2e-3);
        EXPECT_LT((omega - 0.01 * s).norm(), 1e-4);
    }
}

TEST(SunSafe, searches_in_the_dark)
{
    Random random{3};
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        SunSafe m = any(random);
        m.par.hold = 3;
        sun_safe_update(&m, {0, 0});
        m.in.sun.head.quality = lost;
        if (lost == QUALITY_GOOD) {
            m.in.sun.s_B.v[0] = NAN;
        }
        for (int k = 1; k < 6; k++) {
            sun_safe_update(&m, {k * second, second});
            const bool searching = k > 3 || lost == QUALITY_NONE || lost == QUALITY_GOOD;
            EXPECT_EQ(eigen(m.out.error.omega_RN_B) == Vector3d(0, 0.02, 0), searching);
            EXPECT_EQ(vec_norm(m.out.error.sigma_BR) == 0.0, searching);
            EXPECT_EQ(m.out.error.head.quality, QUALITY_DEGRADED);
            EXPECT_EQ(m.out.error.head.t, k * second) << "new, though degraded";
        }
        // The wanted rate rests in B: its inertial derivative is omega_BN x omega_RN.
        EXPECT_LT((eigen(m.out.error.domega_RN_B) - eigen(m.in.rate.omega_BN_B).cross(Vector3d(0, 0.02, 0))).norm(),
                  1e-16);
    }
}

TEST(SunSafe, holds_its_error_without_a_rate)
{
    Random random{4};
    SunSafe m = any(random);
    sun_safe_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.rate.omega_BN_B),
        [](SunSafe &x) {
            sun_safe_update(&x, {second, second});
        },
        [](SunSafe &x) { return std::vector{&x.out.error.head}; });
    m.in.rate.head = {5, QUALITY_DEGRADED, 1};
    sun_safe_update(&m, {second, second});
    EXPECT_EQ(m.out.error.head.t, 5) << "an error from an old rate is old";
}

} // namespace sun_safe_test
} // namespace flight::testing

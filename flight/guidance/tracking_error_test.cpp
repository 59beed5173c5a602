// SPDX-License-Identifier: Apache-2.0
// The tracking error against the algebra of matrices.
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/tracking_error.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace tracking_error_test {

TrackingError any(Random &random)
{
    TrackingError m{};
    m.in.attitude = {good(), random.mrp(), vec(random.vector())};
    m.in.reference = {good(), random.mrp(), vec(random.vector()), vec(random.vector())};
    m.par.sigma_BcB = random.mrp();
    return m;
}

void expect_algebra(TrackingError m)
{
    tracking_error_update(&m, {500, 0});
    const AttError &error = m.out.error;
    Matrix3d BN = dcm(m.in.attitude.sigma_BN), RiN = dcm(m.in.reference.sigma_RN);
    Matrix3d RN = dcm(m.par.sigma_BcB).transpose() * RiN;
    EXPECT_LT(difference(dcm(error.sigma_BR), BN * RN.transpose()), 8e-15);
    EXPECT_LE(vec_norm(error.sigma_BR), 1 + 1e-15);

    Vector3d omega_RN_B = BN * eigen(m.in.reference.omega_RN_N);
    EXPECT_LT((eigen(error.omega_RN_B) - omega_RN_B).norm(), 1e-14);
    EXPECT_LT((eigen(error.omega_BR_B) + omega_RN_B - eigen(m.in.attitude.omega_BN_B)).norm(), 1e-14);
    EXPECT_LT((eigen(error.domega_RN_B) - BN * eigen(m.in.reference.domega_RN_N)).norm(), 1e-14);
    EXPECT_EQ(error.head.t, 500);
    EXPECT_EQ(error.head.quality, QUALITY_GOOD);
}

TEST(TrackingError, is_the_algebra_of_matrices)
{
    Random random{1};
    for (int i = 0; i < 3000; i++) {
        expect_algebra(any(random));
    }
}

TEST(TrackingError, with_half_turns_exactly)
{
    Random random{2};
    for (int i = 0; i < 300; i++) {
        TrackingError m = any(random);
        for (int axis = 0; axis < 3; axis++) {
            for (double sign : {1.0, -1.0}) {
                m.par.sigma_BcB = vec(sign * Vector3d::Unit(axis));
                expect_algebra(m);
                m.in.reference.sigma_RN = vec(sign * Vector3d::Unit(i % 3));
                expect_algebra(m);
                m.in.attitude.sigma_BN = vec(Vector3d::Unit((i + 1) % 3));
                expect_algebra(m);
            }
        }
    }
}

TEST(TrackingError, vanishes_where_the_control_frame_lies_on_the_reference)
{
    Random random{3};
    for (int i = 0; i < 1000; i++) {
        TrackingError m = any(random);
        if (i % 2) {
            m.par.sigma_BcB = vec3(0, 0, 1);
        }
        // [BcN] = [RiN], so [BN] = [BcB]^T [RiN]
        m.in.attitude.sigma_BN = dcm_to_mrp(mat(dcm(m.par.sigma_BcB).transpose() * dcm(m.in.reference.sigma_RN)));
        tracking_error_update(&m, {0, 0});
        EXPECT_LT(vec_norm(m.out.error.sigma_BR), 3e-15);
    }
}

TEST(TrackingError, rate_is_the_derivative_of_the_attitude)
{
    Random random{4};
    for (int i = 0; i < 500; i++) {
        TrackingError m = any(random);
        Matrix3d BN = dcm(m.in.attitude.sigma_BN), RiN = dcm(m.in.reference.sigma_RN);
        Vector3d omega_BN = eigen(m.in.attitude.omega_BN_B);
        Vector3d omega = eigen(m.in.reference.omega_RN_N);
        auto at = [&](double t) -> Matrix3d {
            TrackingError later = m;
            later.in.attitude.sigma_BN = dcm_to_mrp(mat(turn(omega_BN, omega_BN.norm() * t) * BN));
            later.in.reference.sigma_RN = dcm_to_mrp(mat(RiN * turn(omega, omega.norm() * t)));
            tracking_error_update(&later, {0, 0});
            return dcm(later.out.error.sigma_BR);
        };
        tracking_error_update(&m, {0, 0});
        Matrix3d rate = -skew(eigen(m.out.error.omega_BR_B)) * at(0);
        EXPECT_LT(difference(derivative<Matrix3d>(at, 0.05), rate), 1e-10);
    }
}

TEST(TrackingError, quality_is_the_worst_of_both_and_needs_both)
{
    Random random{5};
    TrackingError m = any(random);
    for (Quality attitude : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        for (Quality reference : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
            m.in.attitude.head = with(attitude);
            m.in.reference.head = with(reference);
            tracking_error_reset(&m);
            tracking_error_update(&m, {500, 0});
            Quality worst = std::min(attitude, reference);
            if (worst == QUALITY_NONE) {
                EXPECT_TRUE(all_zero(m.out));
            } else {
                EXPECT_EQ(m.out.error.head.quality, std::max(worst, QUALITY_DEGRADED));
                EXPECT_EQ(m.out.error.head.sequence, 1u);
            }
        }
    }
}

TEST(TrackingError, an_old_attitude_counts_for_a_while)
{
    constexpr std::int64_t second = 1'000'000'000;
    Random random{6};
    for (double hold : {0.0, 0.4, 3.0}) {
        TrackingError m{};
        m.in.attitude = {good(), random.mrp(), vec(random.vector())};
        m.in.reference = {good(), random.mrp(), vec(random.vector()), vec(random.vector())};
        m.par.hold = hold;
        tracking_error_update(&m, {0, 0});
        m.in.attitude.head.quality = QUALITY_STALE;
        const int last = hold > 0 ? static_cast<int>(hold) : 10; // updates, one each second
        for (int k = 1; k < 20; k++) {
            tracking_error_update(&m, {k * second, second});
            ASSERT_EQ(m.out.error.head.quality, QUALITY_DEGRADED);
            ASSERT_EQ(m.out.error.head.t, std::min(k, last) * second) << hold;
        }
        m.in.reference.head.quality = QUALITY_STALE; // a reference may be old
        for (int k = 20; k < 40; k++) {
            m.in.attitude.head.t = k * second;
            tracking_error_update(&m, {k * second, second});
            ASSERT_EQ(m.out.error.head.t, k * second);
        }
    }
}

TEST(TrackingError, holds_the_last_error_against_numbers_that_are_not_finite)
{
    Random random{6};
    TrackingError m = any(random);
    tracking_error_update(&m, {0, 0});
    auto &[attitude, reference] = m.in;
    expect_held(
        m,
        doubles(attitude.sigma_BN, attitude.omega_BN_B, reference.sigma_RN, reference.omega_RN_N, reference.domega_RN_N,
                m.par.sigma_BcB),
        [](TrackingError &x) {
            tracking_error_update(&x, {500, 500});
        },
        [](TrackingError &x) { return std::vector{&x.out.error.head}; });
}

} // namespace tracking_error_test
} // namespace flight::testing

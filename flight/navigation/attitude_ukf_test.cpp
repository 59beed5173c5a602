// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/attitude_filter.h"

extern "C" {
#include "flight/navigation/attitude_ukf.h"
}

namespace flight::testing {
namespace attitude_ukf_test {

/// theta = 4 B^-1 dsigma, by Eigen.
Mat3 to_turn(Vec3 sigma)
{
    const Vector3d s = eigen(sigma);
    const Matrix3d B = (1 - s.squaredNorm()) * Matrix3d::Identity() + 2 * skew(s) + 2 * s * s.transpose();
    return mat(4 * B.inverse());
}

TEST(AttitudeUkf, its_errors_are_as_large_as_it_says)
{
    expect_consistent<AttitudeUkf>(attitude_ukf_update, to_turn);
}

TEST(AttitudeUkf, where_it_is_good_its_errors_are_as_large_as_it_says_whatever_the_sensors_do)
{
    expect_good_is_true<AttitudeUkf>(attitude_ukf_update, to_turn);
}

TEST(AttitudeUkf, its_covariance_is_that_of_a_dense_filter)
{
    expect_riccati<AttitudeUkf>(attitude_ukf_update, to_turn, 1e-3);
}

TEST(AttitudeUkf, converges_from_large_initial_errors)
{
    expect_convergence<AttitudeUkf>(attitude_ukf_update);
}

TEST(AttitudeUkf, late_attitudes_count_at_their_time)
{
    expect_late_as_in_time<AttitudeUkf>(attitude_ukf_update);
}

TEST(AttitudeUkf, faults)
{
    expect_faults<AttitudeUkf>(attitude_ukf_update);
}

TEST(AttitudeUkf, changes_the_set_with_its_covariance)
{
    // A body that turns on and on passes |sigma| = 1 every turn, and the errors stay as they are.
    Flown<AttitudeUkf> f(attitude_ukf_update, 11);
    f.rate = 0.2;
    f.swing = Vector3d(0, 0, 0);
    f.phase = Vector3d(0.1, pi / 2, -0.2);
    int changes = 0;
    Vec3 last = vec3(0, 0, 0);
    for (int k = 0; k < 120; k++) {
        f.run(1);
        changes += vec_dot(last, f.m.mem.filter.at.sigma_BN) < -0.5;
        last = f.m.mem.filter.at.sigma_BN;
        ASSERT_LE(vec_norm(last), 1.0 + 1e-12);
        ASSERT_LT(f.error(), 200 * arc_second);
        ASSERT_LT(vec_norm(f.state().attitude_std), 100 * arc_second);
    }
    EXPECT_GE(changes, 3);
    EXPECT_EQ(f.state().rejected, 0u);
}

} // namespace attitude_ukf_test
} // namespace flight::testing

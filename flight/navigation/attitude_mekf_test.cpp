// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/attitude_filter.h"

extern "C" {
#include "flight/navigation/attitude_mekf.h"
}

namespace flight::testing {
namespace attitude_mekf_test {

Mat3 itself(Vec3)
{
    return mat_identity();
}

TEST(AttitudeMekf, its_errors_are_as_large_as_it_says)
{
    expect_consistent<AttitudeMekf>(attitude_mekf_update, itself);
}

TEST(AttitudeMekf, where_it_is_good_its_errors_are_as_large_as_it_says_whatever_the_sensors_do)
{
    expect_good_is_true<AttitudeMekf>(attitude_mekf_update, itself);
}

TEST(AttitudeMekf, its_covariance_is_that_of_a_dense_filter)
{
    expect_riccati<AttitudeMekf>(attitude_mekf_update, itself, 1e-5);
}

TEST(AttitudeMekf, converges_from_large_initial_errors)
{
    expect_convergence<AttitudeMekf>(attitude_mekf_update);
}

TEST(AttitudeMekf, late_attitudes_count_at_their_time)
{
    expect_late_as_in_time<AttitudeMekf>(attitude_mekf_update);
}

TEST(AttitudeMekf, faults)
{
    expect_faults<AttitudeMekf>(attitude_mekf_update);
}

} // namespace attitude_mekf_test
} // namespace flight::testing

// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/poison.h"

extern "C" {
#include "flight/vehicle/thruster_config.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace thruster_config_test {

ThrusterConfig two()
{
    ThrusterConfig m{};
    m.par.n = 2;
    m.par.r_CB_B = vec3(0, 0, 0.5);
    m.par.r_TB_B[0] = vec3(1, 2, 3);
    m.par.axes_B[0] = vec3(0, 0, -4);
    m.par.axes_B[1] = vec3(3, 0, 4);
    m.par.F_max[0] = m.par.F_max[1] = 5;
    return m;
}

TEST(ThrusterConfig, gives_arms_about_the_centre_of_mass_and_unit_directions)
{
    ThrusterConfig m = two();
    thruster_config_update(&m, {7, 0});
    const ThrusterSet &set = m.out.thrusters;
    EXPECT_EQ(set.n, 2u);
    EXPECT_EQ(eigen(set.r_TC_B[0]), Vector3d(1, 2, 2.5));
    EXPECT_EQ(eigen(set.axes_B[0]), Vector3d(0, 0, -1));
    EXPECT_LT((eigen(set.axes_B[1]) - Vector3d(0.6, 0, 0.8)).norm(), 1e-15);
    EXPECT_EQ(set.head.quality, QUALITY_GOOD);
    EXPECT_EQ(set.head.t, 7);
}

TEST(ThrusterConfig, says_what_is_not_whole_and_holds_against_bad_numbers)
{
    ThrusterConfig m = two();
    thruster_config_update(&m, {0, 0});
    expect_held(
        m, doubles(m.par.r_CB_B, m.par.r_TB_B[1], m.par.axes_B[0], m.par.F_max[1]),
        [](ThrusterConfig &x) {
            thruster_config_update(&x, {1, 1});
        },
        [](ThrusterConfig &x) { return std::vector{&x.out.thrusters.head}; });
    m.par.axes_B[1] = vec3(0, 0, 0);
    thruster_config_update(&m, {1, 1});
    EXPECT_EQ(m.out.thrusters.head.quality, QUALITY_DEGRADED);
    m = two();
    m.par.n = 9;
    thruster_config_update(&m, {1, 1});
    EXPECT_EQ(m.out.thrusters.n, 8u);
    EXPECT_EQ(m.out.thrusters.head.quality, QUALITY_DEGRADED);
}

} // namespace thruster_config_test
} // namespace flight::testing

// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/poison.h"

extern "C" {
#include "flight/vehicle/rod_config.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace rod_config_test {

TEST(RodConfig, publishes_unit_axes_and_says_what_is_not_whole)
{
    RodConfig m{};
    m.par.n = 2;
    m.par.axes_B[0] = vec3(0, -3, 0);
    m.par.axes_B[1] = vec3(0, 3, 4);
    m.par.m_max[0] = 30;
    rod_config_update(&m, {7, 0});
    EXPECT_EQ(eigen(m.out.rods.axes_B[0]), Vector3d(0, -1, 0));
    EXPECT_LT((eigen(m.out.rods.axes_B[1]) - Vector3d(0, 0.6, 0.8)).norm(), 1e-15);
    EXPECT_EQ(m.out.rods.m_max[0], 30.0);
    EXPECT_EQ(m.out.rods.head.quality, QUALITY_GOOD);
    expect_held(
        m, doubles(m.par.axes_B[0], m.par.m_max[1]),
        [](RodConfig &x) {
            rod_config_update(&x, {8, 1});
        },
        [](RodConfig &x) { return std::vector{&x.out.rods.head}; });
    m.par.axes_B[1] = vec3(0, 0, 0);
    rod_config_update(&m, {8, 1});
    EXPECT_EQ(m.out.rods.head.quality, QUALITY_DEGRADED);
    m.par.n = 20;
    rod_config_update(&m, {9, 1});
    EXPECT_EQ(m.out.rods.n, 8u);
}

} // namespace rod_config_test
} // namespace flight::testing

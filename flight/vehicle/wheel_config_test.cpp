// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/eigen.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/vehicle/wheel_config.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace wheel_config_test {

WheelConfig any(Random &random, std::uint32_t n)
{
    WheelConfig m{};
    m.par.n = n;
    for (int i = 0; i < WHEELS_MAX; i++) { // beyond n too
        m.par.axes_B[i] = vec(random.direction() * random.real(0.1, 10));
        m.par.J[i] = random.real(0.01, 1);
        m.par.u_max[i] = random.real(0, 1);
    }
    return m;
}

TEST(WheelConfig, publishes_its_parameters_with_unit_axes)
{
    Random random{1};
    for (std::uint32_t n = 1; n <= WHEELS_MAX; n++) {
        WheelConfig m = any(random, n);
        wheel_config_update(&m, {500, 0});
        const WheelSet &wheels = m.out.wheels;
        EXPECT_EQ(wheels.head.quality, QUALITY_GOOD);
        EXPECT_EQ(wheels.head.t, 500);
        EXPECT_EQ(wheels.head.sequence, 1u);
        EXPECT_EQ(wheels.n, n);
        for (std::uint32_t i = 0; i < WHEELS_MAX; i++) {
            if (i < n) {
                EXPECT_LT((eigen(wheels.axes_B[i]) - eigen(m.par.axes_B[i]).normalized()).norm(), 3e-16);
                EXPECT_EQ(wheels.J[i], m.par.J[i]);
                EXPECT_EQ(wheels.u_max[i], m.par.u_max[i]);
            } else {
                EXPECT_TRUE(all_zero(wheels.axes_B[i]));
                EXPECT_EQ(wheels.J[i], 0);
                EXPECT_EQ(wheels.u_max[i], 0);
            }
        }
    }
}

TEST(WheelConfig, degrades_a_set_with_an_axis_of_no_direction_or_too_many_wheels)
{
    Random random{2};
    WheelConfig m = any(random, 4);
    m.par.axes_B[2] = vec3(0, 0, 0);
    wheel_config_update(&m, {0, 0});
    EXPECT_EQ(m.out.wheels.head.quality, QUALITY_DEGRADED);
    EXPECT_TRUE(all_zero(m.out.wheels.axes_B[2]));

    m = any(random, 9);
    wheel_config_update(&m, {0, 0});
    EXPECT_EQ(m.out.wheels.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.wheels.n, 8u);
}

TEST(WheelConfig, holds_what_it_published_against_numbers_that_are_not_finite)
{
    Random random{3};
    WheelConfig m = any(random, WHEELS_MAX);
    wheel_config_update(&m, {0, 0});
    expect_held(
        m, doubles(m.par.axes_B, m.par.J, m.par.u_max),
        [](WheelConfig &x) {
            wheel_config_update(&x, {500, 500});
        },
        [](WheelConfig &x) { return std::vector{&x.out.wheels.head}; });
}

TEST(WheelConfig, gives_finite_numbers_whatever_it_is_given)
{
    Random random{4};
    WheelConfig m{};
    WheelSet &out = m.out.wheels;
    for (int round = 0; round < 20000; round++) {
        throw_numbers(doubles(m.par.axes_B, m.par.J, m.par.u_max), random, round);
        m.par.n = static_cast<std::uint32_t>(random.below(12));
        wheel_config_update(&m, {round, 1});
        expect_finite(doubles(out.axes_B, out.J, out.u_max), round);
        for (const Vec3 &axis : out.axes_B) {
            double n = vec_norm(axis);
            ASSERT_TRUE(n == 0 || std::fabs(n - 1) < 1e-15) << n;
        }
    }
}

} // namespace wheel_config_test
} // namespace flight::testing

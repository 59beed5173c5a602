// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/eigen.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/vehicle/vehicle_config.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace vehicle_config_test {

TEST(VehicleConfig, publishes_its_parameters)
{
    Random random{1};
    VehicleConfig m{};
    m.par.I_B = mat(random.spd(100));
    vehicle_config_update(&m, {500, 0});
    EXPECT_EQ(eigen(m.out.vehicle.I_B), eigen(m.par.I_B));
    EXPECT_EQ(m.out.vehicle.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.vehicle.head.t, 500);
    EXPECT_EQ(m.out.vehicle.head.sequence, 1u);

    m.par.I_B = mat(random.spd(100)); // changed in flight
    vehicle_config_update(&m, {1000, 500});
    EXPECT_EQ(eigen(m.out.vehicle.I_B), eigen(m.par.I_B));
    EXPECT_EQ(m.out.vehicle.head.sequence, 2u);
}

TEST(VehicleConfig, holds_what_it_published_against_numbers_that_are_not_finite)
{
    VehicleConfig m{};
    m.par.I_B = mat_identity();
    vehicle_config_update(&m, {0, 0});
    expect_held(
        m, doubles(m.par.I_B),
        [](VehicleConfig &x) {
            vehicle_config_update(&x, {500, 500});
        },
        [](VehicleConfig &x) { return std::vector{&x.out.vehicle.head}; });

    VehicleConfig never{};
    never.par.I_B.m[1][1] = NAN;
    vehicle_config_update(&never, {0, 0});
    EXPECT_TRUE(all_zero(never.out));
}

} // namespace vehicle_config_test
} // namespace flight::testing

// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/protection/gyro_select.h"
}

#include <gtest/gtest.h>

#include <limits>

namespace gyro_select_test {

TEST(GyroSelect, TheRateIsThatOfTheGyroInUse)
{
    GyroSelect m{};
    m.par.places[0] = 4;
    m.par.places[1] = 5;
    gyro_select_reset(&m);
    m.in.a = {{8, QUALITY_GOOD, 7}, {{1, 2, 3}}};
    m.in.b = {{9, QUALITY_DEGRADED, 2}, {{4, 5, 6}}};
    m.in.units.head = {9, QUALITY_GOOD, 1};
    m.in.units.state[4] = UNIT_PRIMARY;
    m.in.units.state[5] = UNIT_REDUNDANT;
    gyro_select_update(&m, {10, 10});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[2], 3.0);
    EXPECT_EQ(m.out.rate.head.quality, QUALITY_GOOD);
    m.in.units.state[4] = UNIT_FAULTED;
    m.in.units.state[5] = UNIT_PRIMARY;
    gyro_select_update(&m, {20, 10});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[2], 6.0);
    EXPECT_EQ(m.out.rate.head.t, 9);
    EXPECT_EQ(m.out.rate.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.rate.head.sequence, 2u);
    EXPECT_EQ(m.out.choice.taken, 2u);
    m.in.units.state[5] = UNIT_FAULTED;
    gyro_select_update(&m, {30, 10});
    EXPECT_EQ(m.out.choice.taken, 0u);
    EXPECT_EQ(m.out.rate.head.sequence, 2u);
    EXPECT_EQ(m.out.rate.omega_BN_B.v[2], 6.0);
}

TEST(GyroSelect, ARateThatIsNotFiniteCountsAsNone)
{
    GyroSelect m{};
    m.par.places[1] = 1;
    gyro_select_reset(&m);
    m.in.a = {{8'000'000'000, QUALITY_GOOD, 7}, {{1, 2, 3}}};
    m.in.units.head = {1, QUALITY_GOOD, 1};
    m.in.units.state[0] = UNIT_PRIMARY;
    gyro_select_update(&m, {9'000'000'000, 1});
    m.in.a.head.sequence++;
    m.in.a.omega_BN_B.v[1] = std::numeric_limits<double>::quiet_NaN();
    gyro_select_update(&m, {10'000'000'000, 1});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[1], 2.0);
    EXPECT_EQ(m.out.rate.head.sequence, 1u);
    EXPECT_LT(m.out.rate.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.choice.age[0], 10.0) << "so a rule about a silent gyro sees it";
    m.in.b = {{9'000'000'000, QUALITY_GOOD, 1}, {{4, 5, 6}}};
    m.in.units.state[1] = UNIT_PRIMARY;
    gyro_select_update(&m, {11'000'000'000, 1});
    EXPECT_EQ(m.out.rate.omega_BN_B.v[1], 5.0) << "of two in use the one that speaks";
}

} // namespace gyro_select_test

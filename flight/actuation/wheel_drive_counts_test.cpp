// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/base.h"

extern "C" {
#include "flight/actuation/wheel_drive_counts.h"
}

#include <gtest/gtest.h>

#include <cmath>

namespace flight::testing {
namespace wheel_drive_counts_test {

WheelDriveCounts any()
{
    WheelDriveCounts m{};
    m.par.bits = 14;
    m.par.volts = 10.0;
    m.par.torque_constant = 0.05;
    m.par.resistance = 2.0;
    m.par.back_emf = 0.04;
    m.in.command.head = {0, QUALITY_GOOD, 1};
    wheel_drive_counts_reset(&m);
    return m;
}

TEST(WheelDriveCounts, the_motor_gives_the_torque_to_half_a_count)
{
    WheelDriveCounts m = any();
    m.in.speeds.head = {0, QUALITY_GOOD, 1};
    for (int k = -50; k <= 50; k++) {
        m.in.command.u[2] = 0.004 * k;
        m.in.speeds.Omega[2] = 0.7 * (k % 7) * k / 10.0;
        wheel_drive_counts_update(&m, {0, 0});
        const double volts = 10.0 * m.out.drive.counts[2] / 8192;
        const double torque = 0.05 * (volts - 0.04 * m.in.speeds.Omega[2]) / 2.0; // what the motor makes of them
        EXPECT_NEAR(torque, m.in.command.u[2], 0.05 / 2.0 * 10.0 / 8192 / 2 * (1 + 1e-9));
    }
    EXPECT_EQ(m.mem.saturated, 0u);
    EXPECT_EQ(m.out.drive.counts[0], 0);
}

TEST(WheelDriveCounts, counts_end_at_those_of_the_converter)
{
    WheelDriveCounts m = any();
    m.in.command.u[0] = 1.0;
    m.in.command.u[1] = -1.0;
    wheel_drive_counts_update(&m, {0, 0});
    EXPECT_EQ(m.out.drive.counts[0], 8191);
    EXPECT_EQ(m.out.drive.counts[1], -8192);
    EXPECT_EQ(m.mem.saturated, 1u);
}

TEST(WheelDriveCounts, without_speeds_there_is_no_back_emf)
{
    WheelDriveCounts m = any();
    m.in.speeds.Omega[0] = 100.0; // never written, by its head
    m.in.command.u[0] = 0.05;
    wheel_drive_counts_update(&m, {0, 0});
    EXPECT_EQ(m.out.drive.counts[0], std::lround(2.0 * 8192 / 10));
    EXPECT_EQ(m.out.drive.head.quality, QUALITY_GOOD);
}

TEST(WheelDriveCounts, without_a_number_the_counts_are_held)
{
    WheelDriveCounts m = any();
    m.in.command.u[0] = 0.05;
    wheel_drive_counts_update(&m, {0, 0});
    const auto before = m.out.drive;
    m.in.command.u[0] = NAN;
    wheel_drive_counts_update(&m, {1, 1});
    EXPECT_EQ(m.out.drive.counts[0], before.counts[0]);
    EXPECT_EQ(m.out.drive.head.sequence, before.head.sequence);
    EXPECT_EQ(m.out.drive.head.quality, QUALITY_DEGRADED);
    m.in.command.u[0] = 0.05;
    m.in.speeds.head = {0, QUALITY_GOOD, 1};
    m.in.speeds.Omega[0] = HUGE_VAL;
    m.par.hold = 3;
    for (int k = 1; k < 6; k++) {
        wheel_drive_counts_update(&m, {ns(k), ns(1)});
        EXPECT_EQ(m.out.drive.counts[0], k <= 3 ? before.counts[0] : 0);
        EXPECT_EQ(m.out.drive.head.quality, QUALITY_DEGRADED);
    }
}

TEST(WheelDriveCounts, the_counts_are_held_from_the_last_good_command_on)
{
    WheelDriveCounts m = any();
    m.par.hold = 3;
    m.in.command.u[0] = 0.05;
    for (int k = 100; k < 110; k++) {
        m.in.command.head = k <= 102 ? Head{ns(k), QUALITY_GOOD, 1} : Head{};
        wheel_drive_counts_update(&m, {ns(k), ns(k == 100 ? 0 : 1)});
        EXPECT_EQ(m.out.drive.counts[0] != 0, k <= 105) << k;
    }
    wheel_drive_counts_reset(&m);
    EXPECT_EQ(m.out.drive.head.quality, QUALITY_NONE);
    EXPECT_EQ(m.mem.newest, 0);
    EXPECT_EQ(m.mem.saturated, 0u);
}

} // namespace wheel_drive_counts_test
} // namespace flight::testing

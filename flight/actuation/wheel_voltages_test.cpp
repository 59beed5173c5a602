// SPDX-License-Identifier: Apache-2.0
// Voltages against the motor that they drive.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/wheel_voltages.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace {

constexpr std::int64_t second = 1'000'000'000;

WheelVoltages motor()
{
    WheelVoltages m{};
    m.in.command.head = m.in.wheels.head = m.in.speeds.head = good();
    m.in.wheels.n = 3;
    for (double &J : m.in.wheels.J) {
        J = 0.1;
    }
    m.par = {10, 0.05, 2, 0.05, 0.5, 0, 0};
    return m;
}

/// [N m] What a motor gives for a voltage.
double torque(const WheelVoltages &m, double volts, double Omega)
{
    const double over = volts - m.par.back_emf * Omega;
    const double dead = std::min(std::abs(over), m.par.dead);
    return (over - std::copysign(dead, over)) * m.par.torque_constant / m.par.resistance;
}

TEST(WheelVoltages, the_motor_gives_what_was_commanded)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        WheelVoltages m = motor();
        for (int k = 0; k < 3; k++) {
            m.in.command.u[k] = random.real(-0.1, 0.1);
            m.in.speeds.Omega[k] = random.real(-50, 50);
        }
        wheel_voltages_update(&m, {0, 0});
        for (int k = 0; k < 3; k++) {
            EXPECT_NEAR(torque(m, m.out.drive.volts[k], m.in.speeds.Omega[k]), m.in.command.u[k], 1e-14);
        }
        EXPECT_EQ(m.out.drive.volts[3], 0.0);
        EXPECT_EQ(m.mem.saturated, 0u);
    }
}

TEST(WheelVoltages, feedback_makes_up_for_a_weak_motor)
{
    for (const double gain : {0.0, 0.3}) {
        WheelVoltages m = motor();
        m.par.gain = gain;
        m.par.dead = 0;
        m.in.command.u[0] = 0.05;
        double given = 0;
        for (int k = 0; k < 100; k++) {
            m.in.speeds.head.t = k * second / 10;
            wheel_voltages_update(&m, {k * second / 10, k ? second / 10 : 0});
            given = 0.8 * torque(m, m.out.drive.volts[0], m.in.speeds.Omega[0]);
            m.in.speeds.Omega[0] += given / 0.1 * 0.1;
        }
        // u = u_c + g (u_c - 0.8 u) settles at u = u_c (1 + g) / (1 + 0.8 g).
        EXPECT_NEAR(given, 0.8 * 0.05 * (1 + gain) / (1 + 0.8 * gain), 1e-12);
    }
}

TEST(WheelVoltages, ends_at_its_limit_and_is_off_for_a_wheel_out_of_use)
{
    WheelVoltages m = motor();
    m.in.command.u[0] = 1;
    m.in.command.u[1] = -1;
    m.in.command.u[2] = 0.1;
    m.in.availability = {good(), {1, 1, 0, 1, 1, 1, 1, 1}};
    wheel_voltages_update(&m, {0, 0});
    EXPECT_EQ(m.out.drive.volts[0], 10.0);
    EXPECT_EQ(m.out.drive.volts[1], -10.0);
    EXPECT_EQ(m.out.drive.volts[2], 0.0);
    EXPECT_EQ(m.mem.saturated, 1u);
}

TEST(WheelVoltages, quality_and_bad_numbers)
{
    WheelVoltages m = motor();
    wheel_voltages_update(&m, {0, 0});
    for (auto [bad, value] : {std::pair{&m.in.command.u[0], double{NAN}}, {&m.in.speeds.Omega[1], HUGE_VAL}}) {
        *bad = value;
        const WheelVolts before = m.out.drive;
        wheel_voltages_update(&m, {second, second});
        EXPECT_TRUE(same_content(m.out.drive, before));
        EXPECT_EQ(m.out.drive.head.quality, QUALITY_DEGRADED);
        *bad = 0;
        wheel_voltages_update(&m, {second, second});
        EXPECT_EQ(m.out.drive.head.quality, QUALITY_GOOD);
    }
    m.in.speeds.head = {};
    wheel_voltages_update(&m, {second, second});
    EXPECT_EQ(m.out.drive.head.quality, QUALITY_DEGRADED) << "its back-EMF is unknown";
    m.in.command.u[0] = 0.1;
    wheel_voltages_update(&m, {second, second});
    EXPECT_EQ(m.out.drive.volts[0], 0.1 * 2 / 0.05 + 0.5) << "and counts as none";
    m.par.back_emf = 0;
    wheel_voltages_update(&m, {second, second});
    EXPECT_EQ(m.out.drive.head.quality, QUALITY_GOOD) << "it needs none";
}

TEST(WheelVoltages, a_wheel_that_was_out_of_use_takes_part_again)
{
    WheelVoltages m = motor();
    m.par.gain = 0.5;
    m.in.command.u[1] = 0.1;
    m.in.speeds.Omega[1] = NAN;
    m.in.availability = {good(), {1, 0, 1, 1, 1, 1, 1, 1}};
    wheel_voltages_update(&m, {0, 0});
    m.in.availability.available[1] = 1;
    m.in.speeds.Omega[1] = 0;
    for (int k = 1; k < 3; k++) {
        m.in.speeds.head.t = k * second;
        wheel_voltages_update(&m, {k * second, second});
        EXPECT_EQ(m.out.drive.head.quality, QUALITY_GOOD);
        EXPECT_NEAR(m.out.drive.volts[1], (k == 1 ? 0.1 : 0.15) * 2 / 0.05 + 0.5, 1e-14) << "no torque was missing";
    }
    wheel_voltages_update(&m, {3 * second, second});
    EXPECT_NEAR(m.out.drive.volts[1], 0.1 * 2 / 0.05 + 0.5, 1e-14) << "the speeds are not new";
}

TEST(WheelVoltages, the_voltages_end_without_new_commands)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        WheelVoltages m = motor();
        const std::int64_t begin = lost * 1000 * second;
        m.par.hold = 3;
        m.in.command.u[0] = 0.1;
        m.in.command.head.t = m.in.speeds.head.t = begin;
        wheel_voltages_update(&m, {begin, 0});
        m.in.command.head.quality = lost;
        m.in.speeds.Omega[0] = lost == QUALITY_GOOD ? NAN : 0.0;
        for (int k = 1; k < 8; k++) {
            wheel_voltages_update(&m, {begin + k * second, second});
            EXPECT_EQ(m.out.drive.volts[0] > 0, k <= 3);
            EXPECT_EQ(m.out.drive.head.quality, QUALITY_DEGRADED);
        }
    }
}

} // namespace
} // namespace flight::testing

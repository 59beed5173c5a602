// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/wheel_converter_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <random>

namespace wheel_converter_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Converter {
    WheelConverter i{};
    WheelConverterModel model{i};
    Ns t = 0;

    Converter()
    {
        i.par.n = 2;
        i.par.bits = 12;
        i.par.volts = 10.0;
        i.par.torque_constant = 0.05;
        i.par.resistance = 2.5;
        i.par.marks = 24;
        i.par.window = 500 * ms;
        i.in.drive.head = i.in.speeds.head = {0, QUALITY_GOOD, 1};
        model.reset(0);
        model.update({0, 0});
    }
    void step(Ns dt = 100 * ms)
    {
        t += dt;
        model.update({t, dt});
    }
};

TEST(WheelConverter, ACountIsAVoltAndAVoltIsATorque)
{
    Converter c;
    for (const int counts : {0, 1, -1, 1000, -1000, 2047, -2048}) {
        c.i.in.drive.counts[1] = counts;
        c.step();
        EXPECT_DOUBLE_EQ(c.i.out.torques.u[1], 0.05 / 2.5 * 10.0 * counts / 2048.0);
        EXPECT_EQ(c.i.out.torques.u[0], 0.0);
    }
    EXPECT_EQ(c.i.mem.saturated, 0u);
}

TEST(WheelConverter, CountsAndCurrentsEndAtTheirLimits)
{
    Converter c;
    c.i.in.drive.counts[0] = 5000;
    c.i.in.drive.counts[1] = -5000;
    c.step();
    EXPECT_DOUBLE_EQ(c.i.out.torques.u[0], 0.2 * 2047 / 2048);
    EXPECT_DOUBLE_EQ(c.i.out.torques.u[1], -0.2);
    EXPECT_EQ(c.i.mem.saturated, 1u);
    c.i.par.current_max = 3.0;
    c.i.in.drive.counts[0] = 2000;
    c.step();
    EXPECT_DOUBLE_EQ(c.i.out.torques.u[0], 0.05 * 3.0);
    EXPECT_EQ(c.i.mem.saturated, 2u);
}

TEST(WheelConverter, ADrivenWheelEndsWhereTheBackEmfTakesTheVolts)
{
    // J dOmega = k (V - e Omega) / R: Omega = V / e (1 - exp(-k e t / (J R)))
    Converter c;
    const double J = 0.01, e = 0.05, k = 0.05, R = 2.5, V = 10.0 * 1000 / 2048;
    c.i.par.back_emf = e;
    c.i.in.drive.counts[0] = 1000;
    const Ns dt = ms;
    for (int n = 0; n < 20000; n++) {
        c.step(dt);
        c.i.in.speeds.Omega[0] += c.i.out.torques.u[0] / J * 1e-3;
        const double exact = V / e * (1.0 - std::exp(-k * e / (J * R) * 1e-9 * static_cast<double>(c.t)));
        ASSERT_NEAR(c.i.in.speeds.Omega[0], exact, 5e-3);
    }
    c.i.in.speeds.Omega[0] = V / e;
    c.step();
    EXPECT_NEAR(c.i.out.torques.u[0], 0.0, 1e-15);
    c.i.in.drive.counts[0] = 0; // a short circuit brakes
    c.step();
    EXPECT_NEAR(c.i.out.torques.u[0], -k * V / R, 1e-12);
}

TEST(WheelConverter, WithoutADriveTheMotorsAreOff)
{
    Converter c;
    c.i.par.back_emf = 0.05;
    c.i.in.speeds.Omega[0] = 100.0;
    c.i.in.drive.counts[0] = 1000;
    c.i.in.drive.head = {};
    c.step();
    EXPECT_EQ(c.i.out.torques.u[0], 0.0);
    EXPECT_EQ(c.i.mem.saturated, 0u);
}

TEST(WheelConverter, WithoutPowerItDrivesAndCountsNothing)
{
    Converter c;
    c.i.par.load = 31;
    c.i.in.drive.counts[0] = 1000;
    c.i.in.power.head.quality = QUALITY_GOOD;
    c.i.in.power.on = 0x7FFFFFFF;
    const std::uint32_t sequence = c.i.out.tachometers.head.sequence;
    c.step(500 * ms);
    EXPECT_EQ(c.i.out.torques.u[0], 0.0);
    EXPECT_EQ(c.i.out.tachometers.head.sequence, sequence);
    c.i.in.power.on = 0x80000000;
    c.step(500 * ms);
    EXPECT_GT(c.i.out.torques.u[0], 0.0);
    EXPECT_EQ(c.i.out.tachometers.head.sequence, sequence + 1);
}

TEST(WheelConverter, TachometersCountEachMarkOnceInItsDirection)
{
    // Over any motion the windows' counts add up to the whole marks of the angle turned.
    std::mt19937 random(3);
    std::uniform_real_distribution<double> speed(-300.0, 300.0);
    Converter c;
    double angle = 0.0;
    std::int64_t sum = 0;
    for (int window = 1; window <= 400; window++) {
        const std::uint32_t before = c.i.out.tachometers.head.sequence;
        for (int k = 0; k < 5; k++) {
            c.i.in.speeds.Omega[0] = window < 200 ? speed(random) : 0.3;
            angle += c.i.in.speeds.Omega[0] * 0.1;
            c.step();
            ASSERT_EQ(c.i.out.tachometers.head.sequence, before + (k == 4)) << "at the end of each window";
        }
        sum += c.i.out.tachometers.counts[0];
        ASSERT_LE(std::abs(static_cast<double>(sum) - angle * 24 / (2 * M_PI)), 1.0 + 1e-6);
    }
    EXPECT_EQ(c.i.out.tachometers.counts[1], 0);
    EXPECT_EQ(c.i.out.tachometers.head.t, c.t);
}

TEST(WheelConverter, AConstantSpeedIsReadToOneMark)
{
    for (const double Omega : {250.0, -250.0, 3.0}) {
        Converter c;
        c.i.in.speeds.Omega[0] = Omega;
        for (int k = 0; k < 50; k++) {
            c.step();
        }
        const double marks = Omega * 0.5 * 24 / (2 * M_PI);
        EXPECT_NEAR(c.i.out.tachometers.counts[0], marks, 1.0);
        c.model.reset(0);
        EXPECT_EQ(c.i.out.tachometers.counts[0], 0);
        EXPECT_EQ(c.i.mem.turned[0], 0.0);
    }
}

TEST(WheelConverter, FaultsOfMotorsAndTachometers)
{
    Converter c;
    c.i.par.n_faults = 2;
    c.i.par.faults[0] = {FAULT_DEAD, 1, 0.0, second, 0};
    c.i.par.faults[1] = {FAULT_BIAS, 1u << 9, 3.0, second, 0};
    c.i.in.drive.counts[0] = c.i.in.drive.counts[1] = 1000;
    c.step(500 * ms);
    EXPECT_GT(c.i.out.torques.u[0], 0.0);
    EXPECT_EQ(c.i.out.tachometers.counts[1], 0);
    c.step(500 * ms);
    EXPECT_EQ(c.i.out.torques.u[0], 0.0);
    EXPECT_GT(c.i.out.torques.u[1], 0.0);
    EXPECT_EQ(c.i.out.tachometers.counts[0], 0);
    EXPECT_EQ(c.i.out.tachometers.counts[1], 3);
}

} // namespace wheel_converter_model_test

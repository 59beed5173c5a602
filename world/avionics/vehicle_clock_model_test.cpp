// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/vehicle_clock_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <random>

namespace vehicle_clock_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Clock {
    VehicleClock i{};
    VehicleClockModel model{i};
    Ns t = 0;
    std::uint32_t number = 0;

    Clock()
    {
        i.par.epoch = 700'000'000 * second;
        i.par.start = 40 * second;
        i.par.pulse = second;
        i.par.drift = 12'500;   // 12.5 ppm
        i.par.slew = 1'000'000; // 1 ms per second
        model.reset(0);
        model.update({0, 0});
    }
    const ClockReading &step(Ns dt = 100 * ms)
    {
        t += dt;
        model.update({t, dt});
        return i.out.reading;
    }
    const ClockReading &until(Ns end)
    {
        while (t < end) {
            step();
        }
        return i.out.reading;
    }
    void command(ClockCode code, std::int64_t value)
    {
        i.in.command = {{t, QUALITY_GOOD, 1}, code, ++number, clock_time(value)};
    }
};

TEST(VehicleClock, TheSlaveDriftsAndThePulsesShowIt)
{
    Clock c;
    EXPECT_EQ(c.i.out.reading.pulses, 1u) << "the first pulse is at 0";
    for (int k = 1; k <= 1000; k++) {
        const ClockReading &r = c.until(k * second);
        ASSERT_EQ(r.pulses, static_cast<std::uint32_t>(k + 1));
        ASSERT_EQ(clock_ns(r.master), (700'000'000 + k) * second);
        ASSERT_EQ(clock_ns(r.tone), (40 + k) * second + 12'500 * k);
        ASSERT_EQ(clock_ns(r.time), clock_ns(r.tone));
    }
    EXPECT_EQ(clock_ns(c.step().time), (1040 * second + 12'500 * 1000) + 100 * ms + 1250);
    EXPECT_EQ(clock_ns(c.i.out.reading.tone), 1040 * second + 12'500 * 1000);
}

TEST(VehicleClock, PulsesAreCountedWhateverTheSteps)
{
    std::mt19937 random(4);
    Clock c;
    for (int k = 0; k < 500; k++) {
        const ClockReading &r = c.step(static_cast<Ns>(random() % 3'000'000'000 + 1));
        ASSERT_EQ(r.pulses, c.t / second + 1);
        ASSERT_EQ(clock_ns(r.master) - c.i.par.epoch, c.t / second * second);
    }
}

TEST(VehicleClock, AJamActsFromTheUpdateAtWhichItWasGiven)
{
    Clock c;
    c.until(10'300 * ms);
    c.command(CLOCK_JAM, 5000 * second);
    EXPECT_EQ(clock_ns(c.step().time), 5000 * second + 100 * ms + 1250);
    EXPECT_EQ(c.i.out.reading.done, 1u);
    EXPECT_EQ(clock_ns(c.until(12 * second).tone), 5000 * second + 1700 * ms + 17 * 1250);
    c.step();
    EXPECT_EQ(clock_ns(c.i.out.reading.time) - clock_ns(c.i.out.reading.tone), 100 * ms + 1250) << "obeyed once";
}

TEST(VehicleClock, ASlewGainsItsOffsetAtItsRateAndNoMore)
{
    for (const std::int64_t offset : {3 * ms, -3 * ms}) {
        Clock c;
        c.i.par.drift = 0;
        c.until(10 * second);
        c.command(CLOCK_SLEW, offset);
        for (int k = 1; k <= 50; k++) {
            const ClockReading &r = c.step();
            const std::int64_t done = std::min<std::int64_t>(k * 100'000, 3 * ms) * (offset > 0 ? 1 : -1);
            ASSERT_EQ(clock_ns(r.time), 50 * second + k * 100 * ms + done);
            ASSERT_EQ(r.busy, k < 30 ? 1u : 0u);
        }
    }
}

TEST(VehicleClock, AnAlignedSlaveShowsTheValueAtThePulse)
{
    Clock c;
    c.until(10'700 * ms);
    c.command(CLOCK_ALIGN, 9000 * second);
    EXPECT_LT(clock_ns(c.step().time), 60 * second);
    EXPECT_EQ(c.i.out.reading.busy, 1u);
    const ClockReading &r = c.step(450 * ms); // over the pulse at 11 s
    EXPECT_EQ(clock_ns(r.tone), 9000 * second);
    EXPECT_EQ(clock_ns(r.time), 9000 * second + 250 * ms + 3125);
    EXPECT_EQ(r.busy, 0u);
}

TEST(VehicleClock, AResetOfTheComputerStartsTheSlaveAndNotTheMaster)
{
    Clock c;
    c.until(20'400 * ms);
    c.command(CLOCK_ALIGN, 1);
    c.step();
    c.i.in.command = {};
    c.i.in.computer.count = 1;
    const ClockReading &r = c.step(); // at 20.6 s
    EXPECT_EQ(clock_ns(r.time), 40 * second);
    EXPECT_EQ(r.pulses, 0u);
    EXPECT_EQ(r.done, 0u);
    EXPECT_EQ(r.busy, 0u);
    c.until(21 * second);
    EXPECT_EQ(r.pulses, 1u);
    EXPECT_EQ(clock_ns(r.master), 700'000'021 * second);
    EXPECT_EQ(clock_ns(r.tone), 40 * second + 400 * ms + 5000);
}

} // namespace vehicle_clock_model_test

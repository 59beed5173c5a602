// SPDX-License-Identifier: Apache-2.0
// Flight's half with a clock of the test's own: a line with an offset and a rate, in doubles.
extern "C" {
#include "flight/vehicle/vehicle_time.h"
}

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace vehicle_time_test {

constexpr std::int64_t s = 1'000'000'000;

struct Loop {
    VehicleTime m{};
    double offset, drift; // [ns] of the slave against the master, [ns/s]
    double slew = 0, rate = 1e6;
    bool aligns = false;
    std::int64_t t = 0;

    Loop(double offset_, double drift_) : offset(offset_), drift(drift_)
    {
        m.par.pulse = s;
        m.par.jam_beyond = s / 100;
        m.par.allowed = 20'000;
        vehicle_time_reset(&m);
    }

    /// One second: the pulse, then flight at half a second.
    void second()
    {
        ClockReading &clock = m.in.clock;
        if (aligns) { // as flight requested: the master's time at this pulse
            offset = static_cast<double>(clock_ns(m.out.command.value) - t);
            aligns = false;
        }
        clock.head = {t, QUALITY_GOOD, 1};
        clock.master = clock_time(t);
        clock.tone = clock.time = clock_time(t + std::llround(offset));
        clock.pulses++;
        clock.busy = slew != 0.0;
        vehicle_time_update(&m, {t, s / 2});
        if (m.out.command.number != clock.done) {
            clock.done = m.out.command.number;
            aligns = m.out.command.code == CLOCK_ALIGN;
            slew = m.out.command.code == CLOCK_SLEW ? static_cast<double>(clock_ns(m.out.command.value)) : 0.0;
        }
        const double gained = std::copysign(std::fmin(std::fabs(slew), rate), slew);
        slew -= gained;
        offset += drift + gained;
        t += s;
    }
};

TEST(VehicleTime, a_large_error_is_gone_at_the_next_pulse)
{
    for (const double offset : {-5e12, 5e12, -2e7}) {
        Loop loop(offset, 0.0);
        loop.second();
        EXPECT_EQ(loop.m.out.time.error, std::llround(offset));
        EXPECT_EQ(loop.m.out.time.synchronized, 0u);
        EXPECT_EQ(loop.m.out.time.head.quality, QUALITY_DEGRADED);
        const FlightEvent &event = loop.m.out.event;
        EXPECT_EQ(event.id, VEHICLE_TIME_JUMPS);
        EXPECT_EQ(event.arguments[0], static_cast<double>(std::llround(offset)));
        EXPECT_EQ(event.arguments[1], 1.0);
        loop.second();
        EXPECT_EQ(event.id, VEHICLE_TIME_FOUND);
        EXPECT_EQ(event.count, 2u);
        EXPECT_EQ(loop.m.out.time.error, 0);
        EXPECT_EQ(loop.m.out.time.synchronized, 1u);
        EXPECT_EQ(loop.m.out.time.jams, 1u);
        EXPECT_EQ(loop.m.out.time.time, loop.t - s);
    }
}

TEST(VehicleTime, a_small_error_is_slewed_and_drift_is_held)
{
    Loop loop(5e6, 12'500.0);
    double worst = 0.0;
    for (int k = 0; k < 300; k++) {
        loop.second();
        EXPECT_LE(std::abs(loop.m.out.time.error), 5'000'000) << "it does not overshoot";
        worst = k > 20 ? std::fmax(worst, std::fabs(static_cast<double>(loop.m.out.time.error))) : 0.0;
    }
    EXPECT_EQ(loop.m.out.time.jams, 0u);
    EXPECT_LE(worst, 20'000 + 2 * 12'500) << "what is allowed, and the drift until a slew acts";
}

TEST(VehicleTime, an_allowed_error_stays)
{
    Loop loop(19'000, 0.0);
    for (int k = 0; k < 10; k++) {
        loop.second();
    }
    EXPECT_EQ(loop.m.out.command.code, CLOCK_GOES_ON);
    EXPECT_EQ(loop.m.out.time.synchronized, 1u);
}

TEST(VehicleTime, the_next_command_waits_for_the_last)
{
    Loop loop(5e12, 0.0);
    loop.second();
    loop.m.in.clock.done = 0; // not obeyed yet
    loop.m.in.clock.pulses++;
    const auto before = loop.m.out.command;
    vehicle_time_update(&loop.m, {loop.t, s / 2});
    EXPECT_EQ(loop.m.out.command.number, before.number);
    EXPECT_EQ(clock_ns(loop.m.out.command.value), clock_ns(before.value));
    VehicleTime none{};
    vehicle_time_update(&none, {0, 0});
    EXPECT_EQ(none.out.command.head.quality, QUALITY_NONE);
}

TEST(VehicleTime, a_clock_that_loses_its_time_is_reported_and_one_without_pulses_is_not_judged)
{
    Loop loop(0.0, 0.0);
    loop.second();
    loop.second();
    EXPECT_EQ(loop.m.out.event.id, static_cast<std::uint32_t>(VEHICLE_TIME_FOUND));
    loop.offset = 1e9;
    ClockReading &clock = loop.m.in.clock;
    clock.busy = 1; // it can be set later
    clock.tone = clock_time(clock_ns(clock.master) + s);
    clock.pulses = 0; // it was reset
    vehicle_time_update(&loop.m, {loop.t, s / 2});
    EXPECT_EQ(loop.m.out.time.synchronized, 1u);
    clock.pulses = 1;
    vehicle_time_update(&loop.m, {loop.t, s / 2});
    EXPECT_EQ(loop.m.out.time.synchronized, 0u);
    EXPECT_EQ(loop.m.out.event.id, static_cast<std::uint32_t>(VEHICLE_TIME_LOST));
    EXPECT_EQ(loop.m.out.event.severity, EVENT_LOW);
    EXPECT_EQ(loop.m.out.time.head.quality, QUALITY_DEGRADED);
}

TEST(VehicleTime, an_alignment_beyond_all_times_is_the_last_of_them)
{
    Loop loop(5e12, 0.0);
    loop.t = s;
    loop.m.par.pulse = std::numeric_limits<std::int64_t>::max();
    loop.second();
    const ClockTime last = clock_time(std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(loop.m.out.command.code, CLOCK_ALIGN);
    EXPECT_EQ(loop.m.out.command.value.coarse, last.coarse);
    EXPECT_EQ(loop.m.out.command.value.fine, last.fine);
}

} // namespace vehicle_time_test

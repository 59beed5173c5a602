// SPDX-License-Identifier: Apache-2.0
// The slave clock against its closed form, by the registers that flight sees.
#include "registers/outside.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "registers/testing/board.h"

namespace fledge::registers {

namespace slave_clock_test {

constexpr std::int64_t ms = 1'000'000, s = 1'000 * ms;

/// floor(t * rate), of a rate in ns per second, exactly.
std::int64_t exact(std::int64_t t, std::int64_t rate)
{
    const auto product = static_cast<__int128>(t) * rate;
    return static_cast<std::int64_t>(product / s - (product % s < 0));
}

struct SlaveClockTest : ::testing::TestWithParam<bool> {
    void make(std::int32_t drift, std::int64_t pulse = s, std::int32_t slew = 100'000)
    {
        const RegisterSlave slave = {0, 3, 50 * s, pulse, drift, slew};
        bench.emplace(std::vector<testing::Shape>{}, GetParam(), &slave);
        clock = {};
        clock.window = bench->window();
        register_slave_start(&clock);
    }
    std::int64_t shown(std::int64_t t)
    {
        register_slave_show(&clock, t);
        return register_slave_time(bench->window());
    }
    void command(RegisterSlaveCode code, std::int64_t value, std::int64_t t)
    {
        EXPECT_EQ(register_slave_command(bench->window(), code, value), REGISTER_OK);
        register_slave_obey(&clock, t);
    }
    std::uint32_t status() { return register_slave_status(bench->window()); }

    std::optional<testing::Bench> bench;
    RegisterSlaveClock clock{};
};

TEST_P(SlaveClockTest, DriftsAtItsRateWithoutError)
{
    for (const std::int32_t drift : {0, 1, -1, 12'345, -12'345, 1'000'000'000, -1'000'000'000}) {
        make(drift, 7000 * s);
        std::mt19937_64 random(3);
        std::int64_t t = 0;
        for (int k = 0; k < 1000; k++, t += static_cast<std::int64_t>(random() % 1'000'000'000'000u)) {
            ASSERT_EQ(shown(t), 50 * s + t + exact(t, drift)) << t << " at " << drift;
        }
        EXPECT_EQ(status(), 0u);
        register_slave_start(&clock);
        EXPECT_EQ(shown(0), 50 * s);
    }
}

TEST_P(SlaveClockTest, IsJammedWhenTheTickIsDone)
{
    make(20'000); // 20 ppm
    shown(10 * s);
    EXPECT_EQ(register_slave_command(bench->window(), REGISTER_JAM, -7 * s), REGISTER_OK);
    EXPECT_EQ(register_slave_command(bench->window(), REGISTER_JAM, 1), REGISTER_FULL); // one at a time
    EXPECT_EQ(register_slave_time(bench->window()), 60 * s + 200'000);
    register_slave_obey(&clock, 10 * s);
    register_slave_obey(&clock, 10 * s); // once
    EXPECT_EQ(shown(12 * s), -5 * s + exact(2 * s, 20'000));
    constexpr std::int64_t most = std::numeric_limits<std::int64_t>::max();
    command(REGISTER_JAM, most - s, 12 * s);
    EXPECT_EQ(shown(12 * s + s / 2), most - s / 2 + 10'000);
    EXPECT_LT(shown(20 * s), 0); // as a counter, it wraps
}

TEST_P(SlaveClockTest, IsSlewedByAnOffsetAtItsRate)
{
    for (const std::int64_t sign : {1, -1}) {
        make(-5'000, s, 50'000); // 5 ppm slow, slewed by 50 ppm
        const std::int64_t before = shown(100 * s);
        EXPECT_EQ(before, 150 * s - 500'000);
        command(REGISTER_SLEW, sign * 300'001, 100 * s); // takes 6.00002 s
        EXPECT_EQ(status(), std::uint32_t{REGISTER_SLEWING});
        for (std::int64_t t = 0; t <= 10 * s; t += 250 * ms) {
            const std::int64_t gained = std::min<std::int64_t>(300'001, exact(t, 50'000));
            ASSERT_EQ(shown(100 * s + t), before + t + exact(t, -5'000) + sign * gained);
            EXPECT_EQ(status(), t <= 6 * s ? std::uint32_t{REGISTER_SLEWING} : 0u) << t;
        }
        // A second command replaces what is left of the first, and keeps what is done.
        const std::int64_t now = shown(120 * s);
        command(REGISTER_SLEW, s, 120 * s);
        EXPECT_EQ(shown(122 * s), now + 2 * s - 10'000 + 100'000);
        command(REGISTER_SLEW, 0, 122 * s);
        EXPECT_EQ(status(), 0u);
        EXPECT_EQ(shown(124 * s), now + 4 * s - 20'000 + 100'000);
    }
}

TEST_P(SlaveClockTest, IsAlignedAtTheNextPulse)
{
    make(1'000'000, 2 * s); // 1000 ppm
    EXPECT_EQ(shown(2 * s + 100 * ms), 52 * s + 100 * ms + 2'100'000);
    std::int64_t tone = 0;
    EXPECT_EQ(register_slave_pulses(bench->window(), &tone), 2u); // at 0 and 2 s
    EXPECT_EQ(tone, 52 * s + 2 * ms);
    command(REGISTER_ALIGN, 1000 * s, 2 * s + 100 * ms);
    EXPECT_EQ(status(), std::uint32_t{REGISTER_ALIGNING});
    EXPECT_EQ(shown(3 * s), 53 * s + 3 * ms);
    EXPECT_EQ(status(), std::uint32_t{REGISTER_ALIGNING});
    // The pulse lies between two ticks: from 4 s on the clock has the time of the command.
    EXPECT_EQ(shown(4 * s + 500 * ms), 1000 * s + 500 * ms + 500'000);
    EXPECT_EQ(register_slave_pulses(bench->window(), &tone), 3u);
    EXPECT_EQ(tone, 1000 * s);
    EXPECT_EQ(status(), 0u);
    shown(10 * s);
    EXPECT_EQ(register_slave_pulses(bench->window(), &tone), 6u);
    EXPECT_EQ(tone, 1006 * s + 6 * ms);
    EXPECT_EQ(register_interrupts(bench->window(), 3), 6u);
}

TEST_P(SlaveClockTest, IsAlignedNoMoreAfterAnotherCommand)
{
    make(0, 2 * s);
    shown(100 * ms);
    command(REGISTER_ALIGN, 1000 * s, 100 * ms);
    command(REGISTER_JAM, 7 * s, 100 * ms);
    EXPECT_EQ(status(), 0u);
    EXPECT_EQ(shown(3 * s), 9 * s + 900 * ms); // the pulse at 2 s changed nothing
    command(REGISTER_ALIGN, 1000 * s, 3 * s);
    command(REGISTER_SLEW, 0, 3 * s);
    EXPECT_EQ(status(), 0u);
    EXPECT_EQ(shown(5 * s), 11 * s + 900 * ms);
    command(REGISTER_ALIGN, 1000 * s, 5 * s);
    command(static_cast<RegisterSlaveCode>(9), 0, 5 * s); // what is refused changes nothing
    EXPECT_EQ(status(), std::uint32_t{REGISTER_ALIGNING | REGISTER_REFUSED});
    EXPECT_EQ(shown(6 * s), 1000 * s);
}

TEST_P(SlaveClockTest, ForgetsAtItsStartWhatItWasCommandedBefore)
{
    make(0);
    EXPECT_EQ(register_slave_command(bench->window(), REGISTER_JAM, 7 * s), REGISTER_OK);
    register_slave_start(&clock);
    register_slave_obey(&clock, 0);
    EXPECT_EQ(shown(s), 51 * s);
    EXPECT_EQ(register_slave_command(bench->window(), REGISTER_JAM, 7 * s), REGISTER_OK) << "it is free for the next";
}

TEST_P(SlaveClockTest, RefusesAnUnknownCommand)
{
    make(0);
    shown(s);
    command(static_cast<RegisterSlaveCode>(4), 0, s);
    EXPECT_EQ(status(), std::uint32_t{REGISTER_REFUSED});
    EXPECT_EQ(shown(2 * s), 52 * s);
    EXPECT_EQ(status(), std::uint32_t{REGISTER_REFUSED}); // until the next
    command(REGISTER_JAM, 0, 2 * s);
    EXPECT_EQ(status(), 0u);
}

TEST_P(SlaveClockTest, RunsWithTheTicksOfTheClockThatPaces)
{
    make(100'000, 500 * ms); // 100 ppm
    std::vector<std::int64_t> seen;
    const RegisterBoard *board = &bench->board();
    Backend *memory = nullptr;
    InProcess backend({&board, 1}, [&] {
        const RegisterWindow *w = memory->windows().data();
        Tick tick;
        EXPECT_TRUE(register_clock_due(w, &tick));
        seen.push_back(register_slave_time(w));
        if (tick.t == s) {
            EXPECT_EQ(register_slave_command(w, REGISTER_JAM, 0), REGISTER_OK);
        }
        register_clock_finish(w);
    });
    memory = &backend;
    Outside outside(backend);
    for (const std::int64_t t : {std::int64_t{-1}, std::int64_t{0}, s, 2 * s, std::int64_t{-1}, s}) {
        EXPECT_EQ(outside.tick({t, s}, std::chrono::seconds(1)), Wait::done);
    }
    const std::int64_t drifted = 51 * s + 100'000;
    EXPECT_EQ(seen, (std::vector<std::int64_t>{50 * s, 50 * s, drifted, s + 100'000, 50 * s, drifted}));
}

INSTANTIATE_TEST_SUITE_P(Orders, SlaveClockTest, ::testing::Bool(),
                         [](const auto &order) { return order.param ? "big" : "little"; });

} // namespace slave_clock_test

} // namespace fledge::registers

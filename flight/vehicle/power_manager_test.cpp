// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/vehicle/power_manager.h"
}

#include <gtest/gtest.h>

namespace {

constexpr std::int64_t s = 1'000'000'000;

/// A power unit of three lines: it obeys at once.
struct Loop {
    PowerManager m{};
    std::int64_t t = 0;
    int resets = 0;

    Loop()
    {
        m.par.on = 0b1011;
        m.par.clears = 2;
        m.par.clear_after = 5 * s;
        power_manager_reset(&m);
        m.in.power.head.quality = QUALITY_GOOD;
        m.in.power.number = 41; // of before this start
    }
    void update()
    {
        PowerTelemetry &power = m.in.power;
        power_manager_update(&m, {t, s});
        t += s;
        if (m.out.command.number != power.number && m.out.command.number != 0) {
            power.number = m.out.command.number;
            power.tripped &= ~m.out.command.clear;
            power.on = m.out.command.on & ~power.tripped;
            resets += m.out.command.reset != 0;
        }
    }
    void trip(std::uint32_t load)
    {
        m.in.power.tripped |= 1u << load;
        m.in.power.on &= ~(1u << load);
    }
};

TEST(PowerManager, the_loads_become_those_that_are_wanted)
{
    Loop loop;
    for (const std::uint32_t on : {0b1011u, 0u, 0b0100u}) {
        loop.m.par.on = on;
        loop.update();
        EXPECT_EQ(loop.m.in.power.on, on);
        const std::uint32_t number = loop.m.out.command.number;
        loop.update();
        EXPECT_EQ(loop.m.out.command.number, number) << "one command is enough";
    }
    EXPECT_EQ(loop.resets, 0);
}

TEST(PowerManager, a_trip_is_cleared_after_its_time_and_not_for_ever)
{
    Loop loop;
    loop.update();
    for (int n = 1; n <= 4; n++) {
        loop.trip(1);
        for (int k = 0; k < 12; k++) {
            const bool before = (loop.m.in.power.on >> 1 & 1) != 0;
            loop.update();
            if (n <= 2) {
                EXPECT_EQ((loop.m.in.power.on >> 1 & 1) != 0, k >= 5) << n << ' ' << k << before;
            } else {
                EXPECT_EQ(loop.m.in.power.on, 0b1001u) << "it stays off";
            }
        }
    }
}

TEST(PowerManager, a_command_waits_until_the_last_is_obeyed)
{
    Loop loop;
    power_manager_update(&loop.m, {0, s});
    EXPECT_EQ(loop.m.out.command.number, 42u);
    loop.m.par.on = 0b0100;
    power_manager_update(&loop.m, {s, s});
    EXPECT_EQ(loop.m.out.command.number, 42u);
    EXPECT_EQ(loop.m.out.command.on, 0b1011u);
    loop.m.in.power.number = 42;
    power_manager_update(&loop.m, {2 * s, s});
    EXPECT_EQ(loop.m.out.command.number, 43u);
    EXPECT_EQ(loop.m.out.command.on, 0b0100u);
}

TEST(PowerManager, the_heart_beats_until_it_is_silenced)
{
    Loop loop;
    std::uint32_t last = loop.m.out.command.heartbeat;
    for (int k = 0; k < 5; k++) {
        loop.update();
        EXPECT_NE(loop.m.out.command.heartbeat, last);
        last = loop.m.out.command.heartbeat;
    }
    loop.m.par.silent = 1;
    loop.update();
    EXPECT_EQ(loop.m.out.command.heartbeat, last);
    loop.m.par.reset_computer = 1;
    loop.update();
    EXPECT_EQ(loop.resets, 1);
}

} // namespace

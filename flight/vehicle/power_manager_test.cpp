// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/vehicle/power_manager.h"
}

#include <gtest/gtest.h>

namespace power_manager_test {

constexpr std::int64_t s = 1'000'000'000;

/// A power unit that obeys at once.
struct Loop {
    PowerManager m{};
    std::int64_t t = 0;
    int resets = 0;
    std::uint32_t lost = 0; ///< cards

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
        for (std::uint32_t c = 0; c < SWITCH_CARDS; c++) {
            power.cards[c].counter += (lost >> c & 1) == 0;
        }
        power.counter += (lost >> SWITCH_CARDS & 1) == 0;
        if (m.out.command.number != power.number && m.out.command.number != 0) {
            power.number = m.out.command.number;
            show(m.out.command.on, power_tripped(&power) & ~m.out.command.clear);
            resets += m.out.command.reset != 0;
        }
    }
    std::uint32_t on() const { return power_on(&m.in.power); }
    void show(std::uint32_t on, std::uint32_t tripped)
    {
        for (std::uint32_t c = 0; c < SWITCH_CARDS; c++) {
            if ((lost >> c & 1) == 0) {
                m.in.power.cards[c].on = (on & ~tripped) >> CARD_LOADS * c & 0xFF;
                m.in.power.cards[c].tripped = tripped >> CARD_LOADS * c & 0xFF;
            }
        }
    }
    void trip(std::uint32_t load) { show(on(), power_tripped(&m.in.power) | 1u << load); }
};

TEST(PowerManager, the_loads_become_those_that_are_wanted)
{
    Loop loop;
    for (const std::uint32_t on : {0b1011u, 0u, 0b0100u, 0x80402010u, 0xFFFFFFFFu}) {
        loop.m.par.on = on;
        loop.update();
        EXPECT_EQ(loop.on(), on);
        const std::uint32_t number = loop.m.out.command.number;
        loop.update();
        EXPECT_EQ(loop.m.out.command.number, number) << "one command is enough";
    }
    EXPECT_EQ(loop.resets, 0);
}

TEST(PowerManager, loads_of_units_follow_their_table_and_stay_while_it_waits)
{
    Loop loop;
    loop.update();
    EXPECT_EQ(loop.on(), 0b1011u);
    UnitTable &units = loop.m.in.units;
    units.loads = 0b0110;
    units.powered = 0b0100;
    units.waits = 1;
    loop.update();
    EXPECT_EQ(loop.on(), 0b1011u);
    units.waits = 0;
    loop.update();
    EXPECT_EQ(loop.on(), 0b1101u);
    loop.m.par.on = 0;
    loop.update();
    EXPECT_EQ(loop.on(), 0b0100u);
    units.powered = 0;
    loop.update();
    EXPECT_EQ(loop.on(), 0u);
}

TEST(PowerManager, the_load_of_a_unit_on_a_silent_card_is_not_switched_off_while_the_table_waits)
{
    Loop loop;
    loop.m.par.on = 0x00010001;
    loop.m.par.silent_after = 2 * s;
    loop.update();
    loop.lost = 0b00100;
    loop.m.in.units.loads = 0x00010000;
    loop.m.in.units.waits = 1;
    for (int k = 0; k < 4; k++) {
        loop.update();
    }
    ASSERT_EQ(loop.m.out.state.silent, 0b00100u);
    const std::uint32_t number = loop.m.out.command.number;
    loop.m.par.on = 0x3; // something else is switched meanwhile
    loop.update();
    EXPECT_EQ(loop.m.out.command.number, number + 1);
    EXPECT_EQ(loop.m.out.command.on, 0x00010003u) << "the card may obey although it reports nothing";
}

TEST(PowerManager, how_full_the_battery_is_comes_from_the_last_report)
{
    Loop loop;
    loop.m.in.power.battery = 40000;
    loop.update();
    EXPECT_EQ(loop.m.out.state.battery, 40000u);
}

TEST(PowerManager, a_trip_is_cleared_after_its_time_and_not_for_ever)
{
    Loop loop;
    loop.update();
    for (int n = 1; n <= 4; n++) {
        loop.trip(1);
        for (int k = 0; k < 12; k++) {
            const bool before = (loop.on() >> 1 & 1) != 0;
            loop.update();
            if (n <= 2) {
                EXPECT_EQ((loop.on() >> 1 & 1) != 0, k >= 5) << n << ' ' << k << before;
            } else {
                EXPECT_EQ(loop.on(), 0b1001u) << "it stays off";
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

TEST(PowerManager, a_card_whose_counter_stands_still_is_silent_and_switched_when_it_is_back)
{
    Loop loop;
    loop.m.par.on = 0x01010101;
    loop.m.par.silent_after = 3 * s;
    loop.update();
    loop.update();
    EXPECT_EQ(loop.m.out.state.on, 0x01010101u);
    loop.lost = 0b00100;
    for (int k = 0; k < 4; k++) {
        EXPECT_EQ(loop.m.out.state.silent, 0u) << k;
        loop.update();
    }
    EXPECT_EQ(loop.m.out.state.silent, 0b00100u);
    EXPECT_EQ(loop.m.out.state.on, 0x01000101u) << "its last report says that load 16 is on";
    const std::uint32_t number = loop.m.out.command.number;
    loop.update();
    EXPECT_EQ(loop.m.out.command.number, number) << "nothing is to be switched";
    loop.lost = 0b10000;
    loop.show(0x01000101, 0); // it has come back with its loads off
    for (int k = 0; k < 5; k++) {
        loop.update();
    }
    EXPECT_EQ(loop.m.out.command.number, number + 1);
    EXPECT_EQ(loop.on(), 0x01010101u);
    EXPECT_EQ(loop.m.out.state.silent, 0b10000u) << "the controller";
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

TEST(PowerManager, a_tripped_load_that_is_off_is_cleared_too)
{
    Loop loop;
    loop.update();
    loop.update();
    loop.trip(5);
    for (int k = 0; k < 8; k++) {
        loop.update();
    }
    EXPECT_EQ(power_tripped(&loop.m.in.power), 0u);
    EXPECT_EQ(loop.on(), 0b1011u);
}

} // namespace power_manager_test

// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/actuation/propulsion_manager.h"
}

#include <gtest/gtest.h>

namespace propulsion_manager_test {

constexpr std::int64_t ms = 1'000'000;

struct Loop {
    PropulsionManager m{};
    std::int64_t t = 0;

    Loop()
    {
        m.par.n = 3;
        m.par.armed = 1;
        m.par.persistence = 500 * ms;
        m.par.silent_after = 1000 * ms;
        propulsion_manager_reset(&m);
        m.in.card.head.quality = m.in.times.head.quality = QUALITY_GOOD;
        m.in.card.armed = 1;
        m.in.card.number = 7; // of before this start
    }
    /// Of `steps` of the card from the last update to this one, those in which thrusters were open, and gave thrust.
    void count(std::uint32_t driven, std::uint32_t flowing, std::uint32_t times = 1)
    {
        for (std::size_t i = 0; i < 3; i++) {
            m.in.card.driven[i] += times * (driven >> i & 1u);
            m.in.card.flowing[i] += times * (flowing >> i & 1u);
        }
    }
    const PropulsionCommand &update(std::uint32_t steps = 1)
    {
        m.in.card.counter += steps;
        propulsion_manager_update(&m, {t, t == 0 ? 0 : 250 * ms});
        t += 250 * ms;
        return m.out.command;
    }
    void open(std::size_t i, std::int64_t on, std::int64_t off)
    {
        m.in.times.on[i] = on;
        m.in.times.off[i] = off;
    }
};

TEST(PropulsionManager, times_become_burn_times_and_each_change_has_a_number)
{
    Loop loop;
    EXPECT_EQ(loop.update().number, 8u);
    EXPECT_EQ(loop.m.out.command.armed, 1u);
    EXPECT_EQ(loop.update().number, 8u) << "the same once more";
    loop.open(0, 500 * ms, 620 * ms);
    loop.open(2, 500 * ms, 1000 * ms);
    loop.open(3, 500 * ms, 1000 * ms); // there is no such thruster
    const PropulsionCommand &command = loop.update();
    EXPECT_EQ(command.number, 9u);
    EXPECT_EQ(command.start[0], 500 * ms);
    EXPECT_EQ(command.duration[0], 120 * ms);
    EXPECT_EQ(command.duration[1], 0);
    EXPECT_EQ(command.duration[2], 500 * ms);
    EXPECT_EQ(command.duration[3], 0);
    loop.open(0, 500 * ms, 1250 * ms); // it goes on
    EXPECT_EQ(loop.update().number, 10u);
    EXPECT_EQ(command.duration[0], 750 * ms);
    loop.m.par.armed = 0;
    EXPECT_EQ(loop.update().number, 11u);
    EXPECT_EQ(command.armed, 0u);
    loop.m.in.times.head = {};
    loop.update();
    EXPECT_EQ(command.duration[0] + command.duration[2], 0);
}

TEST(PropulsionManager, numbers_never_become_none)
{
    Loop loop;
    loop.m.in.card.number = 0xFFFFFFFF;
    EXPECT_EQ(loop.update().number, 1u);
}

TEST(PropulsionManager, a_valve_that_differs_for_long_is_stuck)
{
    for (const std::uint32_t steps : {1u, 5u}) {
        Loop loop;
        loop.count(0b011, 0b110, 1000); // of before this start
        loop.update(1000);
        for (int k = 0; k < 4; k++) {
            loop.count(0b001, 0b100, steps);
            loop.update(steps);
            EXPECT_EQ(loop.m.out.health.stuck_shut, k < 2 ? 0u : 0b001u) << k;
            EXPECT_EQ(loop.m.out.health.stuck_open, k < 2 ? 0u : 0b100u) << k;
        }
        // A thrust that falls behind its pulse differs in one report and not in the next.
        for (int k = 0; k < 8; k++) {
            loop.count(0, k % 2 ? 0b110 : 0);
            loop.update(steps);
            EXPECT_EQ(loop.m.out.health.stuck_open, 0u);
        }
    }
}

TEST(PropulsionManager, pulses_between_two_updates_count)
{
    // Five steps of the card in an update. Thruster 0 is sound, and its thrust falls in the step behind a pulse; 1 is
    // stuck shut, and 2 stuck open.
    for (std::uint32_t open = 1; open <= 5; open++) {
        Loop loop;
        loop.update();
        for (int k = 0; k < 4; k++) {
            loop.count(0b111, 0b101, open);
            loop.count(0, 0b101, open < 5);
            loop.count(0, 0b100, open < 5 ? 4 - open : 0);
            loop.update(5);
            EXPECT_EQ(loop.m.out.health.stuck_shut, k < 2 ? 0u : 0b010u) << open;
            EXPECT_EQ(loop.m.out.health.stuck_open, k < 2 || open > 3 ? 0u : 0b100u) << open;
        }
    }
}

TEST(PropulsionManager, an_update_without_a_new_report_changes_nothing)
{
    Loop loop;
    loop.update();
    for (int k = 0; k < 4; k++) {
        loop.count(0b001, 0b100);
        loop.update();
        loop.update(0);
        EXPECT_EQ(loop.m.out.health.stuck_shut, k < 1 ? 0u : 0b001u) << k;
        EXPECT_EQ(loop.m.out.health.stuck_open, k < 1 ? 0u : 0b100u) << k;
    }
}

TEST(PropulsionManager, a_thruster_that_is_stuck_shut_is_not_available_until_it_gives_thrust)
{
    Loop loop;
    loop.update();
    const auto available = [&](std::uint32_t driven, std::uint32_t flowing, std::uint32_t reports = 1) {
        loop.count(driven, flowing, reports);
        loop.update(reports);
        std::uint32_t bits = 0;
        for (std::size_t i = 0; i < THRUSTERS_MAX; i++) {
            bits |= static_cast<std::uint32_t>(loop.m.out.availability.available[i]) << i;
        }
        return bits;
    };
    for (const std::uint32_t driven : {0b001u, 0u, 0u, 0b100u}) { // pulses: the first one gives no thrust
        EXPECT_EQ(available(driven, driven & 0b110), 0b111u) << "once only";
    }
    EXPECT_EQ(available(0b001, 0), 0b110u) << "and again 1 s later";
    for (int k = 0; k < 8; k++) {
        EXPECT_EQ(available(0, 0), 0b110u) << "no command opens it now";
    }
    EXPECT_EQ(loop.m.out.health.stuck_shut, 0b001u);
    for (int k = 1; k <= 4; k++) {
        EXPECT_EQ(available(0, 0, 0), k < 4 ? 0b110u : 0u) << "the card is silent";
    }
    EXPECT_EQ(loop.m.out.health.stuck_shut, 0b001u);
    EXPECT_EQ(available(0b001, 0), 0b110u) << "it reports again";
    EXPECT_EQ(available(0b001, 0b001), 0b111u);
    for (int k = 0; k < 8; k++) { // pulses of which each second one is seen
        EXPECT_EQ(available(0b001, k % 2 ? 0b001 : 0), 0b111u);
    }
    loop.m.in.card.head = {};
    loop.update();
    EXPECT_EQ(loop.m.out.availability.head.quality, QUALITY_DEGRADED);
    propulsion_manager_reset(&loop.m);
    EXPECT_EQ(loop.m.out.health.stuck_shut, 0u);
}

TEST(PropulsionManager, a_card_that_is_lost_or_disarmed_is_named)
{
    Loop loop;
    loop.update();
    EXPECT_EQ(loop.m.out.health.disarmed | loop.m.out.health.silent, 0u);
    loop.m.in.card.armed = 0;
    loop.update();
    EXPECT_EQ(loop.m.out.health.disarmed, 1u);
    loop.m.in.card.armed = 1;
    for (int k = 1; k <= 5; k++) {
        loop.update(0);
        EXPECT_EQ(loop.m.out.health.silent, k >= 4) << k;
        EXPECT_EQ(loop.m.out.health.disarmed, k >= 4) << "its last report says that it is armed";
    }
    loop.update();
    EXPECT_EQ(loop.m.out.health.disarmed | loop.m.out.health.silent, 0u);
    loop.m.in.card.head = {};
    const Head before = loop.m.out.command.head;
    loop.update();
    EXPECT_EQ(loop.m.out.command.head.t, before.t);
    EXPECT_EQ(loop.m.out.command.head.quality, QUALITY_DEGRADED);
}

TEST(PropulsionManager, without_a_limit_no_card_is_silent)
{
    Loop loop;
    loop.m.par.silent_after = 0;
    for (int i = 0; i < 20; i++) {
        loop.update(0);
        EXPECT_EQ(loop.m.out.health.silent, 0u);
    }
}

} // namespace propulsion_manager_test

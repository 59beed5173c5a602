// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/power_unit_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

namespace power_unit_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Unit {
    PowerUnit i{};
    PowerUnitModel model{i};
    Ns t = 0;
    std::uint32_t number = 0;

    Unit()
    {
        i.par.n = 3;
        i.par.on = 0b001;
        i.par.volts = 30.0;
        i.par.inner = 0.5;
        i.par.load[0] = 10.0;
        i.par.load[1] = 20.0;
        i.par.load[2] = 5.0;
        i.par.count_current = 1e-3;
        i.par.count_volts = 1e-3;
        model.prepare({"world.power", 1, nullptr});
        model.reset(0);
        model.update({0, 0});
    }
    const PowerTelemetry &step()
    {
        t += 100 * ms;
        model.update({t, 100 * ms});
        return i.out.telemetry;
    }
    /// Of the first card, whose loads these are.
    const SwitchCard &card() const { return i.out.telemetry.cards[0]; }
    void command(std::uint32_t on, std::uint32_t clear = 0, std::uint32_t reset = 0)
    {
        i.in.command.number = ++number;
        i.in.command.on = on;
        i.in.command.clear = clear;
        i.in.command.reset = reset;
    }
};

TEST(PowerUnit, ABatteryGivesWhatItHoldsAndWhatPanelsBring)
{
    // 10 ohm at 30 V behind 0.5 ohm: the source gives 900 / 10.5 W.
    Unit u;
    const double drawn = 900.0 / 10.5;
    u.i.par.battery = 1000.0;
    u.i.par.charge = 0.5;
    u.model.reset(u.t);
    u.i.in.array.head.quality = QUALITY_GOOD;
    u.i.in.array.power = 40.0;
    u.step(); // begins to draw
    const double full = u.i.mem.energy;
    EXPECT_NEAR(full, 500.0 + 4.0, 1e-9);
    int steps = 0;
    while (u.step().bus > 0) {
        steps++;
        ASSERT_NEAR(u.i.mem.energy, full - 0.1 * steps * (drawn - 40.0), 1e-9);
    }
    EXPECT_EQ(steps, static_cast<int>(full / (0.1 * (drawn - 40.0))));
    EXPECT_EQ(u.card().current[0], 0);
    EXPECT_EQ(u.i.out.supply.on, 0u) << "the switch is on, but the load has no power";
    EXPECT_EQ(u.card().on, 1u);
    EXPECT_EQ(u.i.out.telemetry.battery, 0);
    // Without a load on the bus, the panels charge it: at 5 % it is back.
    steps = 0;
    while (u.step().bus == 0) {
        steps++;
    }
    EXPECT_NEAR(0.1 * steps * 40.0, 50.0, 4.1);
    EXPECT_NEAR(static_cast<double>(u.i.mem.saturated), steps + 1, 1.0) << "health counts them";
    EXPECT_NEAR(u.i.out.telemetry.bus, 1000 * 30.0 * 10.0 / 10.5, 1.0);
    // It is never more than full.
    u.i.in.array.power = 1e6;
    u.step();
    EXPECT_EQ(u.i.mem.energy, 1000.0);
    EXPECT_EQ(u.i.out.telemetry.battery, 65535);
}

TEST(PowerUnit, AnEmptyBatteryIsCountedWithAllLoadsOff)
{
    Unit u;
    u.i.par.battery = 1000.0;
    u.i.par.charge = 0.0;
    u.model.reset(u.t);
    u.command(0);
    for (int step = 0; step < 7; step++) {
        u.step();
    }
    EXPECT_EQ(u.i.mem.saturated, 7u);
    EXPECT_EQ(u.i.out.telemetry.bus, 0);
}

TEST(PowerUnit, CurrentsFollowOhmsLaw)
{
    // R of 10, 20 and 5 ohm side by side: 1 / (0.1 + 0.05 + 0.2)
    Unit u;
    for (std::uint32_t on = 0; on < 8; on++) {
        u.command(on | 0xF0); // there are no such loads
        const PowerTelemetry &r = u.step();
        EXPECT_EQ(power_on(&r), on);
        EXPECT_EQ(u.i.out.supply.on, on);
        EXPECT_EQ(r.number, u.number);
        double conductance = 0.0;
        const double loads[] = {10, 20, 5};
        for (std::uint32_t k = 0; k < 3; k++) {
            conductance += on >> k & 1 ? 1 / loads[k] : 0.0;
        }
        const double total = conductance > 0.0 ? 30.0 / (0.5 + 1 / conductance) : 0.0;
        EXPECT_EQ(r.bus, std::lround((30.0 - 0.5 * total) * 1000));
        double sum = 0.0;
        for (std::uint32_t k = 0; k < 3; k++) {
            EXPECT_EQ(u.card().current[k] > 0, (on >> k & 1) != 0);
            sum += u.card().current[k] * 1e-3;
        }
        EXPECT_NEAR(sum, total, 2e-3) << "Kirchhoff";
    }
}

TEST(PowerUnit, ALatchUpTripsItsLoadAndAClearedTripEndsIt)
{
    Unit u;
    u.command(0b011);
    u.i.par.trip[1] = 3.0;
    u.i.par.trip_after = 500 * ms;
    u.i.par.latch_up_at = 2 * second;
    u.i.par.latch_up_current = 4.0;
    u.i.par.latch_up_load = 1;
    for (; u.t < 1900 * ms; u.step()) {
        ASSERT_EQ(u.card().tripped, 0u);
    }
    for (int k = 1; k <= 4; k++) {
        EXPECT_EQ(power_on(&u.step()), 0b011u);
        // volts = 30 - 0.5 (volts 0.15 + 4); the load has volts / 20 + 4
        EXPECT_NEAR(u.card().current[1], 1000 * (28.0 / 1.075 / 20 + 4), 1.0);
    }
    EXPECT_EQ(power_on(&u.step()), 0b001u);
    EXPECT_EQ(u.card().tripped, 0b010u);
    EXPECT_EQ(u.step().cards[0].current[1], 0);
    u.command(0b011);
    EXPECT_EQ(power_on(&u.step()), 0b001u) << "a trip stays until it is cleared";
    u.command(0b011, 0b010);
    EXPECT_EQ(power_on(&u.step()), 0b011u);
    EXPECT_NEAR(u.card().current[1], 1000 * 30.0 / 1.075 / 20, 1.0) << "the latch-up has gone";
    EXPECT_EQ(u.card().trips, 1u);
}

TEST(PowerUnit, AShortPeakTripsNothing)
{
    Unit u;
    u.i.par.trip[0] = 2.0;
    u.i.par.trip_after = second;
    for (int k = 0; k < 40; k++) {
        u.i.par.load[0] = k % 10 == 9 ? 100.0 : 10.0; // 0.9 s of 2.86 A
        u.step();
    }
    EXPECT_EQ(u.card().tripped, 0u);
}

/// 32 loads of 100 ohm, all on.
struct Full : Unit {
    Full()
    {
        i.par.n = 32;
        i.par.inner = 0.0;
        std::fill(std::begin(i.par.load), std::end(i.par.load), 100.0);
        command(~0u);
        step();
    }
    void lose(std::uint32_t card, Ns begin, Ns lasts)
    {
        i.par.faults[i.par.n_faults++] = {FAULT_DEAD, 1u << card, 0.0, begin, lasts};
    }
};

TEST(PowerUnit, ALostSwitchCardHasNoLoadsAndItsReportsStandStill)
{
    Full u;
    u.lose(2, second, second);
    while (u.t < 900 * ms) {
        u.step();
    }
    EXPECT_EQ(power_on(&u.i.out.telemetry), ~0u);
    const SwitchCard before = u.i.out.telemetry.cards[2];
    EXPECT_EQ(before.counter, u.i.out.telemetry.cards[1].counter);
    for (; u.t < 1900 * ms;) {
        u.command(~0u);
        u.step();
        EXPECT_EQ(u.i.out.supply.on, 0xFF00FFFFu);
        EXPECT_EQ(std::memcmp(&u.i.out.telemetry.cards[2], &before, sizeof before), 0);
        EXPECT_NEAR(u.i.mem.drawn, 24 * 9.0, 1e-9) << "of 24 loads";
    }
    // It comes back with its loads off, until a command.
    EXPECT_EQ(power_on(&u.step()), 0xFF00FFFFu);
    EXPECT_EQ(u.i.out.telemetry.cards[2].counter, before.counter + 1);
    u.command(~0u);
    EXPECT_EQ(power_on(&u.step()), ~0u);
    EXPECT_EQ(u.i.out.supply.on, ~0u);
}

TEST(PowerUnit, ALostControllerObeysNothingAndTheLoadsStay)
{
    Full u;
    u.i.par.watchdog = 300 * ms;
    u.lose(SWITCH_CARDS, 500 * ms, second);
    while (u.t < 400 * ms) {
        u.i.in.command.heartbeat++;
        u.step();
    }
    const PowerTelemetry before = u.i.out.telemetry;
    u.command(1u, 0, 1);
    while (u.t < 1400 * ms) {
        u.step();
        EXPECT_EQ(u.i.out.supply.on, ~0u);
        EXPECT_EQ(u.i.out.telemetry.number, before.number);
        EXPECT_EQ(u.i.out.telemetry.counter, before.counter);
        EXPECT_GT(u.i.out.telemetry.cards[0].counter, before.cards[0].counter);
        EXPECT_EQ(u.i.out.computer.count, 0u);
    }
    u.step();
    EXPECT_EQ(u.i.out.supply.on, 1u) << "it obeys the command that stands";
    EXPECT_EQ(u.i.out.computer.count, 1u);
}

TEST(PowerUnit, TheComputerIsResetByCommandByTimeAndByItsSilence)
{
    Unit u;
    u.command(1, 0, 1);
    u.step();
    u.step();
    EXPECT_EQ(u.i.out.computer.count, 1u) << "once for a command";
    u.i.par.reset_at[2] = 0.5;
    while (u.t < second) {
        u.step();
        EXPECT_EQ(u.i.out.computer.count, u.t < 500 * ms ? 1u : 2u);
    }
    u.i.par.watchdog = 2 * second;
    for (int k = 0; k < 60; k++) {
        u.i.in.command.heartbeat++;
        u.step();
    }
    EXPECT_EQ(u.i.out.computer.count, 2u);
    for (int k = 1; k <= 45; k++) {
        u.step();
        EXPECT_EQ(u.i.out.computer.count, 2u + (k >= 20) + (k >= 40)) << k;
    }
}

} // namespace power_unit_model_test

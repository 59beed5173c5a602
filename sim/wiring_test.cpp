// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace wiring_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::HasSubstr;

TEST(Feed, WhatIsWrittenByHandReplacesTheWire)
{
    // What the wire carried, given by hand at the same times, moves the tank in the same way.
    Loop wired, loop;
    const Port flow = port(loop.tank, "flow");
    loop.sim.feed(flow);
    EXPECT_EQ(loop.sim.wires().size(), 1u);
    loop.sim.run_until(0);
    wired.sim.run_until(0);
    for (int k = 1; k <= 10; k++) {
        interface<Tank>(loop.tank).in.flow = interface<Scale>(wired.control).out.number;
        loop.sim.run_until(k * 500 * ms);
        wired.sim.run_until(k * 500 * ms);
        EXPECT_EQ(loop.level(), wired.level());
    }
    // A clone is fed as well, and a reset forgets what was given.
    const auto clone = loop.sim.clone();
    EXPECT_EQ(clone->feeds().size(), 1u);
    clone->reset();
    clone->run_until(1000 * ms);
    const auto &tank = *reinterpret_cast<const Tank *>(clone->process("world").find("tank")->memory());
    EXPECT_EQ(tank.out.level.x, 8.0);
    EXPECT_EQ(interface<Tank>(loop.tank).in.flow.head.sequence, 10u);
}

TEST(Feed, MessagesOverTimeMoveTheTankAsTheirIntegral)
{
    Simulation sim;
    auto tank = make(sim.add_process("world"), "tank", tank_type);
    sim.process("world").add_task({"dynamics", 100 * ms, 0, 0, {tank}});
    const auto number = [&] { return interface<Tank>(tank).in.flow; };
    sim.feed({port(tank, "flow"), messages({250 * ms, 1000 * ms}, {2.0, 4.0}), false, {}, 0, ""});
    sim.run_until(200 * ms);
    EXPECT_EQ(number().head.quality, QUALITY_NONE);
    sim.run_until(900 * ms); // from 300 ms on, a step ends with the first one
    EXPECT_NEAR(interface<Tank>(tank).out.level.x, 7 * 0.1 * 2.0, 1e-12);
    EXPECT_EQ(number().head.t, 250 * ms);
    // What comes instead is linear, from where the tank stands.
    const double before = interface<Tank>(tank).out.level.x;
    sim.feed({port(tank, "flow"), messages({1000 * ms, 2000 * ms}, {0.0, 10.0}), false, {sizeof(Head)}, 0, ""});
    const auto middle = sim.snapshot();
    for (int i = 0; i < 2; i++) {
        sim.restore(middle);
        sim.run_until(2000 * ms);
        EXPECT_NEAR(interface<Tank>(tank).out.level.x, before + 0.1 * 55.0, 1e-12);
        EXPECT_EQ(number().head.t, 2000 * ms);
    }
    // A constant is new at each instant, as are the messages of a module that runs there.
    sim.feed({port(tank, "flow"), messages({0}, {1.0}), true, {}, 0, ""});
    sim.run_until(3000 * ms);
    EXPECT_NEAR(interface<Tank>(tank).out.level.x, before + 5.5 + 1.0, 1e-12);
    EXPECT_EQ(number().head.t, 3000 * ms);
}

TEST(Feed, AnInputThatIsFedNeedsNoWireAndTakesNone)
{
    Loop loop;
    EXPECT_THAT(error_of([&] { loop.sim.feed(port(loop.control, "product")); }), HasSubstr("is no input"));
    loop.sim.feed(port(loop.control, "number")); // required
    loop.sim.prepare();
    EXPECT_THAT(error_of([&] { loop.sim.connect(port(loop.tank, "level"), port(loop.control, "number")); }),
                HasSubstr("flight.control.number is fed by hand"));
    loop.sim.run_until(0);
    EXPECT_THAT(error_of([&] { loop.sim.feed(port(loop.tank, "flow")); }), HasSubstr("reset it before"));
}

TEST(State, ANumberMayStandInPlaceOfWhatComesToAnInput)
{
    for (const int latency : {0, 1}) {
        Loop loop(WireOptions{latency});
        loop.sim.run_until(500 * ms);
        const auto before = loop.sim.snapshot();
        const auto clone = loop.sim.clone();
        EXPECT_TRUE(loop.sim.override_input(port(loop.tank, "flow"), sizeof(Head), 3.0));
        EXPECT_TRUE(loop.sim.override_input(port(loop.tank, "flow"), sizeof(Head), 2.0));
        EXPECT_FALSE(loop.sim.override_input(port(loop.control, "offset"), sizeof(Head), 3.0)) << "nothing comes there";
        const double level = loop.level();
        loop.sim.run_until(1000 * ms);
        EXPECT_NEAR(loop.level(), level + 0.5 * 2.0, 1e-12);
        EXPECT_EQ(interface<Scale>(loop.control).out.number.x, -0.5 * loop.level()) << "the wires beside it go on";
        loop.sim.restore(before);
        loop.sim.run_until(1000 * ms);
        EXPECT_NEAR(loop.level(), level + 0.5 * 2.0, 1e-12);
        Simulation &other = *clone;
        other.run_until(1000 * ms);
        const double product = interface<Tank>(other.process("world").find("tank")).out.level.x;
        EXPECT_NEAR(product, level - 0.5 * 0.5 * level, 1e-12) << "the clone keeps its wire";
    }
}

TEST(Wires, WithLatencyCarryThePreviousExchange)
{
    // The controller at k sees the level of k-1, and at 0 the initial one.
    Loop loop({}, {.latency = 1});
    double previous = 8.0, level = 8.0;
    for (int k = 0; k < 10; k++) {
        loop.sim.run_until(k * 500 * ms);
        EXPECT_NEAR(loop.level(), level, 1e-12) << "exchange " << k;
        const double next = level - 0.25 * previous;
        previous = level;
        level = next;
    }
}

TEST(Wires, WithLatencyAreExchangedAlsoWhereNoInstantFalls)
{
    // A source at 30, 130, ... ms and its reader at 70, 170, ... ms: exchanges lie at 100, 200, ... ms,
    // so the reader is one message behind, and at first sees what was published at the reset: nothing.
    Simulation sim;
    Process &world = sim.add_process("world");
    Process &flight = sim.add_process("flight");
    auto source = make(world, "source", source_type);
    auto scale = make(flight, "scale", scale_type);
    interface<Source>(source).par = {
        1.0, 1.0
    };
    interface<Scale>(scale).par.gain = 1.0;
    world.add_task({"world", 100 * ms, 30 * ms, 0, {source}});
    flight.add_task({"flight", 100 * ms, 70 * ms, 0, {scale}});
    sim.connect(port(source, "number"), port(scale, "number"), {.latency = 1});
    for (int k = 0; k < 5; k++) {
        sim.run_until((100 * k + 70) * ms);
        EXPECT_EQ(interface<Source>(source).out.number.x, 1.0 + k);
        EXPECT_EQ(interface<Scale>(scale).out.number.x, k) << k;
    }
}

TEST(Wires, WithLatencyFromFlightToTheWorldChangeNothing)
{
    // The world runs first, so a command given at k acts from k on, with latency or without.
    Loop with({.latency = 1}), without;
    for (int i = 0; i < 100; i++) {
        with.sim.step();
        without.sim.step();
        EXPECT_EQ(with.level(), without.level()) << i;
    }
}

TEST(Wires, MarkWhatIsStale)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    auto slow = make(flight, "slow", scale_type);
    auto fast = make(flight, "fast", scale_type);
    auto source = make(flight, "source", source_type);
    interface<Source>(source).par.value = 1.0;
    flight.add_task({"slow", 1000 * ms, 0, 1, {slow}});
    flight.add_task({"fast", 100 * ms, 0, 0, {fast}});
    sim.connect(port(source, "number"), port(slow, "number"));
    sim.connect(port(slow, "product"), port(fast, "number"), {.stale_after = 300 * ms});
    for (int i = 0; i <= 20; i++) {
        sim.run_until(i * 100 * ms);
        const Quality expected = i % 10 > 3 ? QUALITY_STALE : QUALITY_GOOD;
        EXPECT_EQ(interface<Scale>(fast).in.number.head.quality, expected) << i;
        EXPECT_EQ(interface<Scale>(slow).out.number.head.quality, QUALITY_GOOD) << "the producer's own is untouched";
    }
}

TEST(Parts, AreFedByTheirOwnWiresAndAdvancedByTheirOwner)
{
    Simulation sim;
    Process &world = sim.add_process("world");
    Process &flight = sim.add_process("flight");
    auto tank = make(world, "tank", tank_type);
    auto leak = make(world, "leak", leak_type);
    auto source = make(flight, "source", source_type);
    attach(*tank, *leak);
    interface<Tank>(tank).par.initial = 5.0;
    interface<Source>(source).par.value = 2.0;
    world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
    flight.add_task({"gnc", 500 * ms, 0, 0, {source}});
    sim.connect(port(source, "number"), port(leak, "command"));
    sim.run_until(1000 * ms);
    EXPECT_NEAR(interface<Tank>(tank).out.level.x, 5.0 - 2.0 * 1.0, 1e-12);
    world.find("leak");
    for (const bool scheduled : {false, true}) {
        Simulation other;
        Process &w = other.add_process("world");
        auto alone = make(w, "leak", leak_type);
        if (scheduled) {
            w.add_task({"dynamics", 100 * ms, 0, 0, {alone}});
        }
        EXPECT_EQ(error_of([&] { other.prepare(); }),
                  "Leak world.leak is a part of no tank: add it to the `parts` of one, and to no task");
    }
}

} // namespace wiring_test

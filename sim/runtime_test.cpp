// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/testing/allocations.h"
#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>

namespace runtime_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Schedule, AdvancesTheWorldFirstThenFlight)
{
    Loop loop;
    std::vector<Update> seen;
    updates = &seen;
    loop.sim.run_until(500 * ms);
    updates = nullptr;
    ASSERT_EQ(seen.size(), 8u); // the tank at 0, 100, ... 500 ms and the controller at 0 and 500 ms
    EXPECT_EQ(seen[0].memory, loop.tank->memory());
    EXPECT_EQ(seen[1].memory, loop.control->memory());
    EXPECT_EQ(seen[1].t, 0);
    EXPECT_EQ(seen[6].memory, loop.tank->memory());
    EXPECT_EQ(seen[7].memory, loop.control->memory());
    EXPECT_EQ(seen[7].t, 500 * ms);
}

TEST(Schedule, HoldsACommandOverTheFollowingInterval)
{
    // With h = 0.5 s, x' = -0.5 x(k) gives x(k+1) = 0.75 x(k).
    Loop loop;
    double expected = 8.0;
    for (int k = 0; k <= 10; k++) {
        loop.sim.run_until(k * 500 * ms);
        EXPECT_NEAR(loop.level(), expected, 1e-12);
        expected *= 0.75;
    }
}

TEST(Schedule, OrdersEqualTimesByPriorityThenDeclaration)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    std::vector<std::shared_ptr<Instance>> module;
    const int priority[] = {0, 5, 0, 5};
    for (int i = 0; i < 4; i++) {
        const std::string name = std::string("m") + std::to_string(i);
        module.push_back(make(flight, name, source_type));
        interface<Source>(module.back()).par.value = 1.0;
        flight.add_task({name, 10 * ms, 0, priority[i], {module.back()}});
    }
    std::vector<Update> seen;
    updates = &seen;
    sim.step();
    updates = nullptr;
    std::vector<const void *> order;
    for (const Update &update : seen) {
        order.push_back(update.memory);
    }
    EXPECT_THAT(order, ElementsAre(module[1]->memory(), module[3]->memory(), module[0]->memory(), module[2]->memory()));
}

TEST(Schedule, GivesTheTimeSinceTheLastUpdate)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    auto source = make(flight, "source", source_type);
    auto scale = make(flight, "scale", scale_type);
    interface<Source>(source).par.value = 1.0;
    flight.add_task({"late", 30 * ms, 20 * ms, 0, {scale}});
    sim.connect(port(source, "number"), port(scale, "number"));
    sim.step();
    EXPECT_EQ(sim.now(), 20 * ms);
    EXPECT_EQ(interface<Scale>(scale).mem.t, 20 * ms);
    EXPECT_EQ(interface<Scale>(scale).mem.dt, 0);
    sim.step();
    EXPECT_EQ(sim.now(), 50 * ms);
    EXPECT_EQ(interface<Scale>(scale).mem.dt, 30 * ms);
}

TEST(Configuration, IsPublishedAtTheStartAndWhenItsParametersChange)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    auto source = make(flight, "source", source_type); // in no task
    auto scale = make(flight, "scale", scale_type);
    interface<Source>(source).par.value = 3.0;
    interface<Scale>(scale).par.gain = 1.0;
    flight.add_task({"gnc", 10 * ms, 0, 0, {scale}});
    sim.connect(port(source, "number"), port(scale, "number"));
    sim.run_until(1000 * ms);
    EXPECT_EQ(interface<Scale>(scale).out.number.x, 3.0);
    EXPECT_EQ(interface<Source>(source).out.number.head.sequence, 1u);
    interface<Source>(source).par.value = 4.0;
    sim.step();
    EXPECT_EQ(interface<Scale>(scale).out.number.x, 4.0);
    EXPECT_EQ(interface<Source>(source).out.number.head.sequence, 2u);
    interface<Source>(source).par.value = -1.0; // forbidden, and found although no setter saw it
    EXPECT_THAT(error_of([&] { sim.step(); }), HasSubstr("flight.source.value must be > 0, found -1"));
    interface<Source>(source).par.value = 5.0; // mended: the run goes on
    sim.step();
    EXPECT_EQ(interface<Scale>(scale).out.number.x, 5.0);
}

TEST(Parameters, OfTheInitialStateCountUntilTheFirstInstant)
{
    Loop loop;
    loop.sim.reset();
    interface<Tank>(loop.tank).par.initial = 3.0;
    loop.sim.step();
    EXPECT_EQ(loop.level(), 3.0);
    interface<Tank>(loop.tank).par.initial = 5.0; // too late for this run
    EXPECT_EQ(error_of([&] { loop.sim.step(); }),
              "world.tank.initial is an initial value, and the run has come to 0 s: a change has no effect; reset the "
              "simulation first");
    loop.sim.reset();
    EXPECT_EQ(loop.level(), 5.0);
    loop.sim.step();
}

TEST(Runs, AddUpWhateverThePeriods)
{
    for (const Ns part : {1 * ms, 50 * ms, 99 * ms, 130 * ms, 333 * ms, 1700 * ms}) {
        Loop whole, parts;
        Ns end = 0;
        while (end < 20'000 * ms) {
            end += part;
            parts.sim.run_until(parts.sim.time() < 0 ? part : parts.sim.time() + part);
            ASSERT_EQ(parts.sim.time(), end);
            ASSERT_EQ(parts.sim.now(), end / (100 * ms) * (100 * ms));
        }
        whole.sim.run_until(end);
        EXPECT_EQ(whole.level(), parts.level()) << part;
        EXPECT_EQ(whole.sim.now(), parts.sim.now());
    }
}

TEST(Runs, ThatAreStoppedGoOnFromTheLastInstant)
{
    Loop loop;
    loop.sim.run_until(130 * ms);
    EXPECT_EQ(loop.sim.time(), 130 * ms);
    EXPECT_FALSE(loop.sim.run_until(3600'000 * ms, {.pace = 1000.0, .poll = [](Ns now) { return now < 0; }}));
    EXPECT_EQ(loop.sim.time(), loop.sim.now());
    const auto saved = loop.sim.snapshot();
    const Ns stopped = loop.sim.time();
    loop.sim.run_until(stopped + 30 * ms);
    EXPECT_EQ(loop.sim.time(), stopped + 30 * ms);
    loop.sim.restore(saved);
    EXPECT_EQ(loop.sim.time(), stopped);
}

TEST(Runs, ReachATimeOnlyIfNoInstantIsDue)
{
    Loop loop;
    EXPECT_THROW(loop.sim.reach(0), RunError);
    loop.sim.run_until(0);
    loop.sim.reach(99 * ms);
    EXPECT_EQ(loop.sim.time(), 99 * ms);
    EXPECT_EQ(loop.sim.now(), 0);
    EXPECT_THROW(loop.sim.reach(100 * ms), RunError);
}

TEST(Runs, AModeThatIsRequestedBetweenThemBeginsAtTheNextInstantOfItsTasks)
{
    // Alone, or beside a process that has more instants: the same times.
    for (const bool beside : {false, true}) {
        Simulation sim;
        if (beside) {
            Process &world = sim.add_process("world");
            const auto other = make(world, "other", source_type);
            interface<Source>(other).par.value = 1.0;
            world.add_task({"fast", 100 * ms, 0, 0, {other}});
        }
        Process &flight = sim.add_process("flight");
        const auto slow = make(flight, "slow", source_type), fast = make(flight, "fast", source_type);
        interface<Source>(slow).par.value = interface<Source>(fast).par.value = 1.0;
        flight.add_task({"slow", 1000 * ms, 0, 0, {slow}});
        flight.add_task({"fast", 300 * ms, 0, 0, {fast}});
        flight.add_mode({"rest", {"slow"}});
        flight.add_mode({"work", {"fast"}});
        sim.run_until(1250 * ms);
        flight.enter("work");
        sim.run_until(2000 * ms);
        EXPECT_EQ(interface<Source>(fast).out.number.head.sequence, 2u) << beside; // 1.5 s and 1.8 s, not 1.2 s
        EXPECT_EQ(interface<Source>(fast).out.number.head.t, 1800 * ms) << beside;
        EXPECT_EQ(interface<Source>(slow).out.number.head.sequence, 2u) << beside; // 0 s and 1 s
    }
}

TEST(Loop, DoesNotAllocate)
{
    Loop loop({.latency = 1}, {.stale_after = 50 * ms});
    Event event;
    event.name = "low";
    event.condition = below(loop.tank, 4.0);
    event.action = [] {};
    loop.sim.process("world").add_event(std::move(event));
    loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 0);
    const std::string path = ::testing::TempDir() + "no_heap.mcap";
    loop.sim.recorder().open_archive(path, {});
    loop.sim.run_until(0);
    // What run_until does before its loop may allocate (room for the records); ten times as many
    // instants must not cost one allocation more.
    const auto allocations_of = [&](Ns until) {
        const fledge::sim::testing::Allocations allocations;
        loop.sim.run_until(until);
        return allocations.count();
    };
    const long few = allocations_of(1'000 * ms);
    const long many = allocations_of(10'000'000 * ms);
    EXPECT_LE(many, few) << "100,000 instants more";
    EXPECT_EQ(loop.sim.recorder().logs()[0]->times.size(), 100'001u);
    loop.sim.recorder().close_archive();
    std::remove(path.c_str());
}

TEST(Pace, FollowsTheWallClockAndStopsOnRequest)
{
    Loop loop;
    loop.sim.run_until(0);
    const auto start = std::chrono::steady_clock::now();
    EXPECT_TRUE(loop.sim.run_until(2000 * ms, {.pace = 10.0, .poll = {}}));
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(200));
    EXPECT_EQ(loop.sim.pace_report().instants, 20u);
    int polls = 0;
    const auto poll = [&](Ns) { return ++polls < 3; };
    EXPECT_FALSE(loop.sim.run_until(3600'000 * ms, {.pace = 1.0, .poll = poll})) << "requested to stop";
    const Ns there = loop.sim.now();
    EXPECT_LT(there, 3600'000 * ms);
    EXPECT_TRUE(loop.sim.run_until(there + 1000 * ms)) << "and can go on";
    const auto refuse = [](Ns) { return false; };
    EXPECT_FALSE(loop.sim.run_until(1'000'000'000'000 * ms, {.pace = 1e12, .poll = refuse}))
        << "requested to stop, while it is late";
    EXPECT_FALSE(loop.sim.run_until(1'000'000'000'000 * ms, {.poll = refuse})) << "requested to stop, without a pace";
}

} // namespace runtime_test

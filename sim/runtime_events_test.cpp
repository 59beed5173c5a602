// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace runtime_events_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Process, RefusesWhatCannotBeAnEvent)
{
    Loop loop;
    Process &flight = loop.sim.process("flight");
    flight.add_mode({"rest", {}});
    const auto never = [] { return false; };
    const auto with = [&](const auto &change) {
        Event event;
        event.name = "e";
        event.predicate = never;
        event.mode = "rest";
        change(event);
        return error_of([&] { flight.add_event(event); });
    };
    const Condition condition({Operand::of(1.0), Operand::of(2.0), EXEC_LESS}, "1 < 2");
    EXPECT_EQ(with([](Event &e) { e.predicate = nullptr; }), "event flight.e needs one condition");
    EXPECT_EQ(with([&](Event &e) { e.condition = condition; }), "event flight.e needs one condition");
    EXPECT_EQ(with([](Event &e) { e.mode = ""; }),
              "event flight.e does nothing: give it a mode to enter or something to do");
    EXPECT_EQ(with([](Event &e) { e.count = 0; }), "event flight.e: the count must be >= 1, found 0");
    EXPECT_EQ(with([](Event &e) { e.hold = -1; }),
              "event flight.e: the time to hold must be >= 0, found -0.000000001 s");
    EXPECT_EQ(with([&](Event &e) { e.once = true, e.until = condition; }),
              "event flight.e: with once, it does not arm itself again: leave out until");
    EXPECT_EQ(with([](Event &e) { e.mode = "west"; }), "event flight.e enters the mode west; the process has rest");
    EXPECT_EQ(with([](Event &e) {
                  e.modes = {"rest", "west"};
              }),
              "event flight.e looks in the mode west; the process has rest");
    EXPECT_EQ(error_of([&] { flight.add_mode({"rest", {}}); }), "mode flight.rest is already there");
    EXPECT_EQ(error_of([&] {
                  flight.add_mode({"west", {"gnc", "gone"}});
              }),
              "mode flight.west names the task gone; the process has gnc");

    // What an event may set: what flies, but its initial values, in its own process.
    Process &other = loop.sim.add_process("other");
    const auto twin = make(other, "control", scale_type);
    const auto setting = [&](const std::shared_ptr<Instance> &instance, std::string_view field) {
        return with([&](Event &e) {
            e.set = {{instance, find_field(instance->type(), field)->offset, std::vector<std::byte>(8)}};
            e.mode = "";
        });
    };
    const std::string own = ": an event sets what modules of its own process have";
    EXPECT_EQ(setting(twin, "gain"), "event flight.e sets other.control.gain" + own);
    EXPECT_EQ(setting(loop.tank, "initial"), "event flight.e sets world.tank.initial" + own);
    for (const char *field : {"saturated", "number"}) {
        EXPECT_THAT(setting(loop.control, field), HasSubstr("an event sets parameters, but for initial values, and "));
    }
    EXPECT_EQ(setting(loop.control, "gain"), "");

    const auto named = [&](const char *name, const auto &change) {
        return with([&](Event &e) { e.name = name, change(e); });
    };
    EXPECT_EQ(with([](Event &) {}), "event flight.e is already there");
    EXPECT_EQ(named("once", [](Event &e) { e.once = true; }), "");
    EXPECT_EQ(named("until", [&](Event &e) { e.until = condition; }), "");
    EXPECT_EQ(named("arms", [](Event &e) { e.mode = "", e.arms = {{"once", false}}; }), "");
    EXPECT_EQ(named("acts", [](Event &e) { e.mode = "", e.action = [] {}; }), "");
    EXPECT_EQ(named("least", [](Event &e) { e.count = 1, e.hold = 0, e.modes = {"rest"}; }), "");
}

TEST(Process, ChecksAnEventThatComesDuringARun)
{
    Loop loop;
    loop.sim.run_until(500 * ms);
    const auto add = [&](const char *name, bool armed) {
        Event event;
        event.name = name;
        event.predicate = [] { return true; };
        event.action = [] {};
        event.armed = armed;
        return loop.sim.process("world").add_event(std::move(event));
    };
    Process &world = loop.sim.process("world");
    const auto on = add("on", true), off = add("off", false);
    EXPECT_TRUE(world.armed(*on));
    EXPECT_FALSE(world.armed(*off));
    EXPECT_EQ(world.fired_at(*on), -1);
    loop.sim.run_until(1000 * ms);
    EXPECT_EQ(world.fired_at(*on), 600 * ms);
    EXPECT_EQ(world.fired_at(*off), -1);
    world.arm(*off, true);
    loop.sim.run_until(1500 * ms);
    EXPECT_EQ(world.fired_at(*off), 1100 * ms);
}

TEST(Modes, TakeEffectAtTheNextInstantAndResetWhatBecomesActive)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    auto source = make(flight, "source", source_type);
    auto a = make(flight, "a", scale_type);
    auto b = make(flight, "b", scale_type);
    interface<Source>(source).par.value = 1.0;
    flight.add_task({"always", 10 * ms, 0, 0, {source}});
    flight.add_task({"a", 10 * ms, 0, 0, {a}});
    flight.add_task({"b", 20 * ms, 0, 0, {b}});
    flight.add_mode({"first", {"a"}});
    flight.add_mode({"second", {"b"}});
    sim.connect(port(source, "number"), port(a, "number"));
    sim.connect(port(source, "number"), port(b, "number"));
    sim.run_until(50 * ms);
    EXPECT_EQ(flight.mode(), "first");
    EXPECT_EQ(interface<Scale>(a).mem.updates, 6);
    EXPECT_EQ(interface<Scale>(b).mem.updates, 0);
    flight.enter("second");
    EXPECT_EQ(flight.mode(), "first") << "not before the next instant";
    sim.run_until(80 * ms);
    EXPECT_EQ(flight.mode(), "second");
    EXPECT_EQ(interface<Scale>(a).mem.updates, 6) << "no longer active";
    EXPECT_EQ(interface<Scale>(b).mem.updates, 2) << "at 60 and 80 ms, on its own grid";
    flight.enter("first");
    sim.run_until(90 * ms);
    EXPECT_EQ(interface<Scale>(a).mem.updates, 1) << "reset when it became active";
    EXPECT_EQ(interface<Scale>(a).mem.dt, 0);
    sim.reset();
    EXPECT_EQ(flight.mode(), "first");
    EXPECT_THAT(error_of([&] { flight.enter("third"); }),
                HasSubstr("process flight has no mode third; it has first and second"));
}

TEST(Modes, AreEnteredAtAnInstantOfTheirProcessAndInItsTurn)
{
    // The instants of the world are none of flight's. A task that runs before it sees its reset only afterwards.
    Simulation sim;
    Process &world = sim.add_process("world");
    Process &flight = sim.add_process("flight");
    auto source = make(flight, "source", source_type);
    auto idle = make(flight, "idle", source_type);
    auto reader = make(world, "reader", scale_type);
    interface<Source>(source).par.value = interface<Source>(idle).par.value = 1.0;
    interface<Scale>(reader).par.gain = 1.0;
    world.add_task({"look", 10 * ms, 0, 0, {reader}});
    flight.add_task({"idle", 100 * ms, 0, 0, {idle}});
    flight.add_task({"work", 100 * ms, 50 * ms, 0, {source}});
    flight.add_mode({"working", {"work"}});
    flight.add_mode({"resting", {}});
    sim.connect(port(source, "number"), port(reader, "number"));
    sim.run_until(60 * ms);
    EXPECT_EQ(interface<Scale>(reader).out.number.x, 1.0);
    flight.enter("resting");
    sim.run_until(90 * ms);
    EXPECT_EQ(flight.mode(), "working") << "it has had no instant since";
    sim.run_until(100 * ms);
    EXPECT_EQ(flight.mode(), "resting");
    flight.enter("working");
    sim.run_until(140 * ms);
    EXPECT_EQ(interface<Scale>(reader).in.number.head.sequence, 1u) << "not yet reset";
    sim.run_until(150 * ms);
    EXPECT_EQ(flight.mode(), "working");
    EXPECT_EQ(interface<Scale>(reader).in.number.head.t, 50 * ms) << "it ran before flight did";
    EXPECT_EQ(interface<Source>(source).out.number.head.t, 150 * ms);
    EXPECT_EQ(interface<Source>(source).out.number.head.sequence, 1u) << "reset, then updated";
}

TEST(Modes, ThatAFunctionRequestsCountForTheTurnsBehindIt)
{
    for (const bool general : {false, true}) {
        Simulation sim;
        Process &world = sim.add_process("world");
        Process &flight = sim.add_process("flight");
        auto source = make(world, "source", source_type);
        auto work = make(flight, "work", source_type);
        interface<Source>(source).par.value = interface<Source>(work).par.value = 1.0;
        world.add_task({"look", 10 * ms, 0, 0, {source}});
        flight.add_task({"work", 10 * ms, 0, 0, {work}});
        flight.add_mode({"working", {"work"}});
        flight.add_mode({"resting", {}});
        int fired = 0;
        Event event;
        event.predicate = [&] { return sim.time() >= 50 * ms; };
        event.action = [&] { fired++; };
        if (general) { // an event, so that the loop asks each process at each instant
            event.name = "early";
            flight.add_event(event);
        }
        source->script.update = [&](Instance &, Tick tick) {
            if (tick.t == 50 * ms) {
                flight.enter("resting");
                event.name = "late";
                world.add_event(event);
            }
        };
        sim.run_until(40 * ms);
        EXPECT_EQ(flight.mode(), "working");
        sim.run_until(50 * ms);
        EXPECT_EQ(flight.mode(), "resting");
        EXPECT_EQ(interface<Source>(work).out.number.head.sequence, 5u) << "at 0 to 40 ms";
        EXPECT_EQ(fired, 1) << "at the end of the instant";
    }
}

TEST(Events, FireOnceTheirConditionHeldAndArmAgainWhenItNoLongerHolds)
{
    Loop loop;
    std::vector<Ns> fired;
    Event event;
    event.name = "low";
    event.condition = below(loop.tank, 4.0);
    event.hold = 200 * ms;
    event.action = [&] { fired.push_back(loop.sim.now()); };
    loop.sim.process("world").add_event(std::move(event));
    loop.sim.run_until(5000 * ms);
    // x = 8, 6, 4.5, 3.375 at 0, 0.5, 1, 1.5 s: below 4 from 1.3 s on (4.5 - 0.225 n).
    EXPECT_THAT(fired, ElementsAre(1500 * ms));
    loop.sim.reset();
    loop.sim.run_until(5000 * ms);
    EXPECT_THAT(fired, ElementsAre(1500 * ms, 1500 * ms));
}

TEST(Events, ThatRearmThemselvesAtTheSameInstantAreAnError)
{
    Loop loop;
    Event event;
    event.name = "restless";
    event.condition = below(loop.tank, 4.0);
    std::shared_ptr<Event> handle;
    event.action = [&] { loop.sim.process("world").arm(*handle, true); };
    handle = loop.sim.process("world").add_event(std::move(event));
    const std::string error = error_of([&] { loop.sim.run_until(5000 * ms); });
    EXPECT_THAT(error, HasSubstr("event world.restless fires again at 1.3 s"));
    EXPECT_THAT(error, HasSubstr("world.tank.level.x < 4"));
    EXPECT_THAT(error_of([&] { loop.sim.step(); }), HasSubstr("the run ended: event world.restless"));
    loop.sim.reset();
    loop.sim.run_until(1000 * ms); // a reset heals
}

TEST(Events, ChangeTheMode)
{
    Loop loop;
    Process &flight = loop.sim.process("flight");
    flight.add_mode({"active", {"gnc"}});
    flight.add_mode({"idle", {}});
    Event event;
    event.name = "done";
    event.condition = below(loop.tank, 4.0);
    event.mode = "idle";
    flight.add_event(std::move(event));
    loop.sim.run_until(5000 * ms);
    EXPECT_EQ(flight.mode(), "idle");
    // The level falls below 4 at 1.3 s; flight runs, and so looks, at 1.5 s.
    EXPECT_EQ(interface<Scale>(loop.control).mem.t, 1500 * ms);
}

TEST(Events, DoNotEnterAModeWhoseConditionDoesNotHold)
{
    Loop loop;
    Process &flight = loop.sim.process("flight");
    flight.add_mode({"active", {"gnc"}});
    flight.add_mode({"idle", {}, below(loop.tank, 3.5), {"active"}});
    EXPECT_EQ(flight.modes()[0].guard(), "");
    EXPECT_EQ(flight.modes()[1].guard(), "after active, if world.tank.level.x < 3.500000");
    Event event;
    event.name = "low"; // at 1.3 s, when the level is 4.05 - 0.225 n; 3.375 at 1.5 s
    event.condition = below(loop.tank, 5.0);
    event.count = 1;
    event.mode = "idle";
    flight.add_event(std::move(event));
    loop.sim.run_until(1200 * ms);
    const auto clone = loop.sim.clone();
    for (Simulation *sim : {&loop.sim, clone.get()}) {
        sim->run_until(1400 * ms);
        Process &own = sim->process("flight");
        EXPECT_EQ(own.fired_at(*own.event("low")), 1000 * ms);
        EXPECT_EQ(own.mode(), "active") << "the level is 4.5 then";
        EXPECT_FALSE(own.may_enter(1));
        EXPECT_EQ(
            error_of([&] { own.enter("idle"); }),
            "mode flight.idle may be entered only after active, if world.tank.level.x < 3.500000, which is not so "
            "at 1.4 s in the mode active");
        sim->run_until(2000 * ms);
        own.enter("idle");
        sim->run_until(2500 * ms);
        EXPECT_EQ(own.mode(), "idle");
        EXPECT_FALSE(own.may_enter(1)) << "not from itself";
    }
    EXPECT_THAT(loop.sim.cross_process_dependencies("world"),
                ::testing::Contains(::testing::Pair("flight.idle", "world.tank")));
    loop.sim.reset();
    flight.add_mode({"rest", {}, {}, {"gone", "idle"}});
    EXPECT_EQ(error_of([&] { loop.sim.run_until(0); }),
              "mode flight.rest is entered after gone; the modes of flight are active, idle and rest");
}

} // namespace runtime_events_test

// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/archive_file.h"
#include "sim/testing/allocations.h"
#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

namespace simulation_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr Ns ms = 1'000'000;

std::shared_ptr<Instance> make(Process &process, const std::string &name, const FledgeStruct &type)
{
    auto instance = std::make_shared<Instance>(type);
    process.add(name, instance);
    return instance;
}

std::shared_ptr<Instance> make(Process &process, const std::string &name, const ModelType &type)
{
    auto instance = std::make_shared<Instance>(type);
    process.add(name, instance);
    return instance;
}

/// Good Numbers, each valid at its time.
std::shared_ptr<const Messages> messages(std::vector<Ns> times, std::initializer_list<double> values)
{
    Messages made{std::move(times), {}};
    std::size_t i = 0;
    for (const double x : values) {
        const Number number{{i < made.times.size() ? made.times[i] : 0, QUALITY_GOOD, static_cast<std::uint32_t>(++i)},
                            x};
        const auto *first = reinterpret_cast<const std::byte *>(&number);
        made.bytes.insert(made.bytes.end(), first, first + sizeof number);
    }
    return std::make_shared<Messages>(std::move(made));
}

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

TEST(State, BlocksSayWhereASnapshotHasWhat)
{
    Loop loop(WireOptions{1});
    EXPECT_TRUE(loop.sim.state_blocks().empty());
    loop.sim.run_until(600 * ms);
    const auto bytes = loop.sim.snapshot();
    std::map<std::string, double> seen;
    for (const auto &block : loop.sim.state_blocks()) {
        ASSERT_LE(block.offset + block.size, bytes.size());
        const auto at = [&](std::size_t offset) {
            double x;
            std::memcpy(&x, bytes.data() + block.offset + offset, sizeof x);
            return x;
        };
        if (block.kind == Simulation::StateBlock::INSTANCE && block.path == "world.tank") {
            seen["level"] = at(offsetof(Tank, out) + offsetof(Number, x));
        } else if (block.kind == Simulation::StateBlock::HELD) {
            seen[block.path] = at(offsetof(Number, x));
        }
    }
    EXPECT_EQ(seen.at("level"), loop.level());
    EXPECT_EQ(seen.at("world.tank.flow"), interface<Tank>(loop.tank).in.flow.x);
}

TEST(Process, RefusesWhatCannotBeATask)
{
    Loop loop;
    Process &world = loop.sim.process("world");
    const auto one = make(world, "one", source_type), two = make(world, "two", source_type);
    const auto refused = [&](const Task &task, const std::string &why) {
        EXPECT_EQ(error_of([&] { world.add_task(task); }), "task world." + task.name + why);
    };
    refused({"a", 0, 0, 0, {one}}, ": its period must be > 0, found 0 s");
    refused({"a", -1, 0, 0, {one}}, ": its period must be > 0, found -0.000000001 s");
    refused({"a", 1, -1, 0, {one}}, ": its offset must be >= 0, found -0.000000001 s");
    refused({"a", 1, 0, 0, {}}, " runs nothing");
    refused({"a", 1, 0, 0, {one, two, one}}, " runs world.one, which is already in task world.a");
    refused({"a", 1, 0, 0, {one, loop.tank}}, " runs world.tank, which is already in task world.dynamics");
    refused({"a", 1, 0, 0, {loop.control}}, " runs flight.control, which is not in the process world; it has tank, "
                                            "one and two");
    EXPECT_EQ(error_of([&] { world.add_task({"a", 1, 0, 0, {one, two}}); }), "(no error)");
    refused({"a", 1, 0, 0, {one}}, " is already there");
}

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
    EXPECT_EQ(setting(loop.control, "gain"), "(no error)");

    const auto named = [&](const char *name, const auto &change) {
        return with([&](Event &e) { e.name = name, change(e); });
    };
    EXPECT_EQ(with([](Event &) {}), "event flight.e is already there");
    EXPECT_EQ(named("once", [](Event &e) { e.once = true; }), "(no error)");
    EXPECT_EQ(named("until", [&](Event &e) { e.until = condition; }), "(no error)");
    EXPECT_EQ(named("arms", [](Event &e) { e.mode = "", e.arms = {{"once", false}}; }), "(no error)");
    EXPECT_EQ(named("acts", [](Event &e) { e.mode = "", e.action = [] {}; }), "(no error)");
    EXPECT_EQ(named("least", [](Event &e) { e.count = 1, e.hold = 0, e.modes = {"rest"}; }), "(no error)");
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

TEST(Process, NamesWhatItHasNot)
{
    Loop loop;
    Process &flight = loop.sim.process("flight");
    EXPECT_EQ(error_of([&] { flight.start_in("west"); }), "process flight has no mode west; it has (none)");
    flight.add_mode({"rest", {}});
    EXPECT_EQ(flight.mode(), "rest") << "the first mode is the one to begin with";
    flight.add_mode({"west", {}});
    EXPECT_EQ(flight.mode(), "rest");
    flight.start_in("west");
    EXPECT_EQ(flight.mode(), "west");
    flight.add_mode({"east", {}});
    EXPECT_EQ(flight.mode(), "west") << "later modes change nothing";
    EXPECT_EQ(error_of([&] { flight.enter("south"); }), "process flight has no mode south; it has rest, west and east");
    EXPECT_EQ(flight.find("gone"), nullptr);
    EXPECT_EQ(flight.event("gone"), nullptr);
    const FledgeField *input = port(loop.control, "number").field;
    EXPECT_EQ(error_of([&] {
                  flight.play(*loop.control, {input, messages({0}, {1.0}), false, {}});
              }),
              "flight.control.number is no output: a playback is of those");
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

TEST(Playback, PutsOutWhatWasPutOutElsewhereWhateverParametersAndModesSay)
{
    const auto fly = [](Process &world, Process &flight) {
        auto scale = make(flight, "scale", scale_type);
        interface<Scale>(scale).par.gain = -0.5;
        flight.add_task({"gnc", 500 * ms, 0, 0, {scale}});
        flight.add_mode({"rest", {}});
        flight.add_mode({"control", {"gnc"}});
        auto tank = make(world, "tank", tank_type);
        interface<Tank>(tank).par.initial = 8.0;
        world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
        return std::pair{tank, scale};
    };
    Simulation sim;
    Process &world = sim.add_process("world");
    Process &flight = sim.add_process("flight");
    const auto [tank, scale] = fly(world, flight);
    sim.connect(port(tank, "level"), port(scale, "number"));
    sim.connect(port(scale, "product"), port(tank, "flow"));
    const FledgeField *output = port(scale, "product").field;
    EXPECT_THAT(error_of([&] {
                    flight.play(*tank, {output, messages({0}, {1.0}), false, {}});
                }),
                HasSubstr("world.tank.product is not of the process flight"));
    EXPECT_THAT(error_of([&] {
                    flight.play(*scale, {output, messages({0, 0}, {1.0, 2.0}), false, {}});
                }),
                HasSubstr("flight.scale.product: the times of messages must rise; found 0 s, then 0 s"));
    EXPECT_THAT(error_of([&] {
                    flight.play(*scale, {output, messages({0, 500 * ms}, {1.0}), false, {}});
                }),
                HasSubstr("flight.scale.product: expected a message of 24 bytes for each time"));
    flight.play(*scale, {output, messages({0, 1000 * ms}, {2.0, -3.0}), false, {}});
    const auto level = [](Simulation &one) { return interface<Tank>(one.process("world").find("tank")).out.level.x; };
    for (Simulation *one : {&sim, sim.clone().release()}) {
        one->run_until(1000 * ms);
        EXPECT_NEAR(level(*one), 8.0 + 2.0, 1e-12);
        Scale &played = interface<Scale>(one->process("flight").find("scale"));
        EXPECT_EQ(played.in.number.x, level(*one)); // what flows in is the world's; the initial mode runs no task
        EXPECT_EQ(played.mem.updates, 0);
        played.par.gain = 7.0;
        one->process("flight").enter("control");
        one->run_until(2000 * ms);
        EXPECT_EQ(one->process("flight").mode(), "control");
        EXPECT_NEAR(level(*one), 8.0 + 2.0 - 3.0, 1e-12);
        if (one != &sim) {
            delete one;
        }
    }
    EXPECT_THAT(error_of([&] {
                    flight.play(*scale, {output, messages({0}, {1.0}), false, {}});
                }),
                HasSubstr("has run until 2 s"));
}

TEST(Playback, AFunctionFliesInPlaceOfTheModules)
{
    Simulation sim;
    Process &world = sim.add_process("world");
    Process &flight = sim.add_process("flight");
    auto scale = make(flight, "scale", scale_type), other = make(flight, "other", scale_type);
    auto tank = make(world, "tank", tank_type);
    interface<Scale>(scale).par.gain = interface<Scale>(other).par.gain = interface<Tank>(tank).par.initial = 1.0;
    flight.add_task({"gnc", 500 * ms, 0, 0, {scale, other}});
    world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
    sim.connect(port(tank, "level"), port(scale, "number"));
    sim.connect(port(tank, "level"), port(other, "number"));
    sim.connect(port(scale, "product"), port(tank, "flow"));
    std::vector<Ns> called;
    flight.fly_by([&](Ns t) {
        called.push_back(t);
        Number level{};
        std::memcpy(&level, flight.incoming(port(scale, "number")).data(), sizeof level);
        EXPECT_EQ(level.x, interface<Tank>(tank).out.level.x); // the world came first
        interface<Scale>(scale).out.number.x = -1.0;
    });
    sim.run_until(1000 * ms);
    EXPECT_EQ(called, (std::vector<Ns>{0, 500 * ms, 1000 * ms})); // once at each instant
    EXPECT_EQ(interface<Scale>(scale).mem.updates, 0);
    EXPECT_NEAR(interface<Tank>(tank).out.level.x, 1.0 - 1.0, 1e-12);
    const auto snapshot = sim.snapshot();
    for (int again = 0; again < 2; again++) {
        sim.run_until(1500 * ms);
        sim.restore(snapshot);
    }
    EXPECT_EQ(called.size(), 5u); // also at the instant at which it was called last
    EXPECT_THAT(error_of([&] { (void)sim.clone(); }), HasSubstr("flight is flown by a computer outside"));
}

TEST(Playback, OtherProcessesReadWhatWasSentToThem)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    Process &world = sim.add_process("world");
    auto source = make(flight, "source", source_type);
    auto own = make(flight, "own", scale_type), other = make(world, "other", scale_type);
    interface<Source>(source).par.value = interface<Scale>(own).par.gain = interface<Scale>(other).par.gain = 1.0;
    flight.add_task({"gnc", 10 * ms, 0, 0, {source, own}});
    world.add_task({"dynamics", 10 * ms, 0, 0, {other}});
    sim.connect(port(source, "number"), port(own, "number"));
    sim.connect(port(source, "number"), port(other, "number"));
    for (const bool sent : {false, true}) {
        Number number{};
        number.x = sent ? 2.5 : 2.4375;
        const auto *first = reinterpret_cast<const std::byte *>(&number);
        flight.play(*source, {port(source, "number").field,
                              std::make_shared<Messages>(Messages{{0}, {first, first + sizeof number}}),
                              sent,
                              {}});
    }
    sim.step();
    for (int again = 0; again < 2; again++) {
        EXPECT_EQ(interface<Source>(source).out.number.x, 2.4375);
        EXPECT_EQ(interface<Scale>(own).in.number.x, 2.4375);
        EXPECT_EQ(interface<Scale>(other).in.number.x, 2.5);
        sim.step();
    }
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
    // The instants of the world are none of flight's. Who runs before it sees its reset only afterwards.
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

Condition below(const std::shared_ptr<Instance> &tank, double x)
{
    Operand level;
    level.instance = tank;
    level.offset = offsetof(Tank, out.level.x);
    return {{level, Operand::of(x), EXEC_LESS}, "world.tank.level.x < " + std::to_string(x)};
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

TEST(Isolate, LeavesOneProcessThatIsAsItWas)
{
    Loop loop;
    loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 0);
    const auto kept = loop.sim.recorder().record(loop.control, *find_field(loop.control->type(), "product"), 0);
    Process &world = loop.sim.process("world"), &flight = loop.sim.process("flight");
    Event event;
    event.name = "low";
    event.condition = below(loop.tank, 4.0);
    event.action = [] {};
    world.add_event(std::move(event));
    EXPECT_TRUE(loop.sim.cross_process_dependencies("world").empty());
    loop.sim.isolate("flight");
    ASSERT_EQ(loop.sim.processes().size(), 1u);
    EXPECT_TRUE(loop.sim.wires().empty());
    EXPECT_THAT(loop.sim.recorder().logs(), ElementsAre(kept));
    EXPECT_EQ(world.tasks().size(), 1u) << "who holds it still may";
    EXPECT_THAT(error_of([&] { loop.sim.prepare(); }), HasSubstr("flight.control.number is not wired"));
    EXPECT_EQ(flight.find("control"), loop.control);
}

TEST(Isolate, IsRefusedWhereMoreThanWiresJoinTheProcesses)
{
    Loop loop;
    auto leak = make(loop.sim.process("flight"), "leak", leak_type);
    attach(*loop.tank, *leak);
    Event event;
    event.name = "low";
    event.condition = below(loop.tank, 4.0);
    event.action = [] {};
    loop.sim.process("flight").add_event(std::move(event));
    for (const char *process : {"world", "flight"}) {
        EXPECT_THAT(error_of([&] { loop.sim.isolate(process); }),
                    AllOf(HasSubstr("world.tank depends on flight.leak, of another process"),
                          HasSubstr("flight.low depends on world.tank")));
    }
    EXPECT_EQ(loop.sim.processes().size(), 2u);
    EXPECT_EQ(loop.sim.wires().size(), 2u);

    Loop other;
    other.sim.step();
    EXPECT_THAT(error_of([&] { other.sim.isolate("flight"); }), HasSubstr("reset it before its structure"));
}

TEST(Snapshot, RestoresARunToTheBit)
{
    for (int latency : {0, 1}) {
        Loop loop({.latency = latency}, {.stale_after = 1});
        loop.sim.run_until(700 * ms);
        const auto bytes = loop.sim.snapshot();
        loop.sim.run_until(3000 * ms);
        const auto end = loop.sim.snapshot();
        loop.sim.restore(bytes);
        EXPECT_EQ(loop.sim.now(), 700 * ms);
        loop.sim.run_until(3000 * ms);
        EXPECT_EQ(loop.sim.snapshot(), end);

        loop.sim.restore(bytes);
        const auto clone = loop.sim.clone();
        loop.sim.run_until(3000 * ms);
        EXPECT_EQ(clone->now(), 700 * ms);
        EXPECT_EQ(clone->snapshot(), bytes) << "the clone did not move with the original";
        clone->run_until(3000 * ms);
        EXPECT_EQ(clone->snapshot(), end);
    }
}

TEST(Begin, ALateOneGivesWhatOneAtZeroGives)
{
    Loop early, late;
    late.sim.begin_after(999 * ms); // the system does not depend on time
    EXPECT_EQ(late.sim.next(), 1000 * ms);
    for (Ns t = 0; t <= 3000 * ms; t += 100 * ms) {
        early.sim.run_until(t);
        late.sim.run_until(t + 1000 * ms);
        ASSERT_EQ(late.level(), early.level()) << t;
    }
    late.sim.begin_after(1000 * ms); // not at this instant, and each task on its own grid
    EXPECT_EQ(late.sim.next(), 1100 * ms);
    EXPECT_EQ(late.level(), 8.0);
    late.sim.run_until(1400 * ms);
    EXPECT_EQ(late.level(), 8.0); // there was no command yet
    late.sim.run_until(1600 * ms);
    EXPECT_LT(late.level(), 8.0);
    late.sim.reset();
    EXPECT_EQ(late.sim.next(), 0);
}

TEST(Snapshot, OfAnotherSimulationIsRefused)
{
    Loop loop;
    loop.sim.run_until(0);
    Simulation empty;
    empty.prepare();
    EXPECT_THAT(error_of([&] { empty.restore(loop.sim.snapshot()); }), HasSubstr("other modules, tasks or events"));
}

TEST(Snapshot, ThatIsDamagedIsRefusedAndChangesNothing)
{
    Loop loop({.latency = 1});
    loop.sim.run_until(700 * ms);
    const auto good = loop.sim.snapshot();
    loop.sim.run_until(1500 * ms);
    const auto now = loop.sim.snapshot();
    const auto refused = [&](const std::vector<std::byte> &bytes) {
        return error_of([&] { loop.sim.restore(bytes); }).find("truncated or damaged") != std::string::npos &&
               loop.sim.snapshot() == now;
    };
    for (std::size_t bit = 0; bit < 8 * good.size(); bit++) {
        auto bytes = good;
        bytes[bit / 8] ^= std::byte(1u << bit % 8);
        ASSERT_TRUE(refused(bytes)) << bit;
    }
    for (std::size_t n = 0; n < good.size(); n++) {
        ASSERT_TRUE(refused({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)})) << n;
    }
    auto longer = good;
    for (int i = 0; i < 16; i++) {
        longer.push_back(std::byte{0});
        ASSERT_TRUE(refused(longer)) << i;
    }
    loop.sim.restore(good);
    EXPECT_EQ(loop.sim.snapshot(), good);

    auto edited = now;
    edited.back() ^= std::byte{1};
    loop.sim.restore(edited, true);
    EXPECT_NE(loop.sim.snapshot(), now) << "a caller who says so may change numbers";
    edited.pop_back();
    EXPECT_THAT(error_of([&] { loop.sim.restore(edited, true); }), HasSubstr("other modules, tasks or events"));
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

TEST(Recorder, TakesSamplesOnItsGridAndForgetsThemOnReset)
{
    Loop loop;
    auto log = loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 250 * ms);
    loop.sim.run_until(1000 * ms);
    // 250 and 750 ms are no instants: the sample comes with the next one. Recording adds none.
    EXPECT_THAT(log->times, ElementsAre(0, 300 * ms, 500 * ms, 800 * ms, 1000 * ms));
    Number sample;
    std::memcpy(&sample, log->bytes.data() + 2 * sizeof sample, sizeof sample);
    EXPECT_NEAR(sample.x, 6.0, 1e-12);
    EXPECT_EQ(log->topic(), "/world/tank/level");
    const auto half = loop.sim.snapshot();
    loop.sim.run_until(2000 * ms);
    loop.sim.restore(half);
    EXPECT_EQ(log->times.size(), 5u);
    loop.sim.run_until(1500 * ms);
    EXPECT_EQ(log->times.back(), 1500 * ms);
    loop.sim.reset();
    EXPECT_TRUE(log->times.empty());
    loop.sim.run_until(0);
    EXPECT_THAT(log->times, ElementsAre(0));
}

/// Keeps the times at which it looked, and ends the run at one of them.
struct Looker : Watcher {
    void take(Ns t) override
    {
        times.push_back(t);
        stop = t == last;
    }
    void rewind(Ns now) override { went.push_back(now); }

    std::vector<Ns> times, went;
    Ns last = -1;
};

TEST(Recorder, AWatcherLooksOnItsGridAndMayEndTheRun)
{
    Loop loop;
    auto looker = std::make_shared<Looker>();
    looker->every = 250 * ms;
    looker->last = 500 * ms;
    loop.sim.recorder().watch(looker);
    EXPECT_FALSE(loop.sim.run_until(1000 * ms));
    EXPECT_EQ(loop.sim.time(), 500 * ms);
    const auto half = loop.sim.snapshot();
    EXPECT_TRUE(loop.sim.run_until(1000 * ms)); // it goes on
    EXPECT_THAT(looker->times, ElementsAre(0, 300 * ms, 500 * ms, 800 * ms, 1000 * ms));
    loop.sim.restore(half);
    loop.sim.reset();
    EXPECT_THAT(looker->went, ElementsAre(-1, 500 * ms, -1));
    EXPECT_TRUE(loop.sim.clone()->run_until(1000 * ms)); // which has no watcher
    EXPECT_EQ(looker->times.size(), 5u);
}

TEST(Recorder, AnArchiveHasChunksAndTheirIndex)
{
    Loop loop;
    loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 0);
    const std::string path = ::testing::TempDir() + "chunks.mcap";
    loop.sim.recorder().open_archive(path, {});
    loop.sim.run_until(1000 * ms);
    loop.sim.recorder().close_archive();
    std::ifstream file(path, std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(file), {});
    std::remove(path.c_str());
    std::map<int, int> records; // opcode -> how many, outside of chunks
    for (std::size_t at = 8; at + 9 + 8 <= bytes.size();) {
        std::uint64_t size;
        std::memcpy(&size, bytes.data() + at + 1, sizeof size);
        records[bytes[at]]++;
        at += 9 + size;
    }
    constexpr int message = 5, chunk = 6, message_index = 7, chunk_index = 8;
    EXPECT_EQ(records[message], 0);
    EXPECT_EQ(records[chunk], 1);
    EXPECT_EQ(records[message_index], 1) << "of the one channel";
    EXPECT_EQ(records[chunk_index], 1);
}

TEST(Recorder, SaysWhenTheDiskIsFullAndKeepsWhatIsReadable)
{
    Loop loop;
    for (const char *name : {"number", "product"}) {
        loop.sim.recorder().record(loop.control, *find_field(loop.control->type(), name), 0);
    }
    EXPECT_THAT(error_of([&] { loop.sim.recorder().open_archive("/nowhere/at/all.mcap", {}); }),
                HasSubstr("cannot write /nowhere/at/all.mcap: No such file or directory"));
    loop.sim.run_until(1000 * ms); // not the worse for it
    Loop second;
    const std::string path = ::testing::TempDir() + "one_at_a_time.mcap";
    loop.sim.recorder().open_archive(path, {});
    EXPECT_THAT(error_of([&] { second.sim.recorder().open_archive(path, {}); }),
                HasSubstr("cannot write " + path + ": another run writes " + path + ".part now"));
    EXPECT_THAT(error_of([&] { second.sim.recorder().archive_metadata("more", {}); }), HasSubstr("no archive is open"));
    loop.sim.recorder().archive_metadata("more", {{"key", "value"}});
    loop.sim.recorder().close_archive();
    std::remove(path.c_str());
}

TEST(ArchiveFile, TakesMessagesOfAnySizeAndSaysWhyItCannot)
{
    const std::string path = ::testing::TempDir() + "large.mcap";
    const std::vector<std::byte> image(5 << 20, std::byte{7});
    ArchiveFile file(path, 1);
    const auto channel = file.add_channel("/camera/image", "Image", "uint8[5242880] pixels\n");
    file.message(channel, 0, 1, image);
    file.message(channel, 1, 2, image);
    EXPECT_THAT(error_of([&] { file.message(channel, -1, 3, image); }),
                HasSubstr("cannot write " + path + ": bad argument; what was written before is in " + path + ".part"));
    EXPECT_GT(std::filesystem::file_size(path + ".part"), 2 * image.size());

    rlimit old{};
    getrlimit(RLIMIT_FSIZE, &old);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{1 << 20, old.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    ArchiveFile limited(path, 1);
    const auto again = limited.add_channel("/camera/image", "Image", "uint8[5242880] pixels\n");
    const std::string why = error_of([&] { limited.message(again, 0, 1, image); });
    const rlimit none{0, old.rlim_max};
    setrlimit(RLIMIT_FSIZE, &none);
    const std::string at_once = error_of([] { ArchiveFile(::testing::TempDir() + "none.mcap", 1); });
    setrlimit(RLIMIT_FSIZE, &old);
    std::signal(SIGXFSZ, handler);
    EXPECT_THAT(at_once, HasSubstr("none.mcap: the file would exceed the limit on its size"));
    EXPECT_THAT(why, HasSubstr("cannot write " + path + ": the file would exceed the limit on its size"));
    std::remove((path + ".part").c_str());
}

TEST(ArchiveFile, AProgramGoesOnWithTheFileOfALostOneWheneverThatWasKilled)
{
    const std::string path = ::testing::TempDir() + "taken.mcap", part = path + ".part", lost = path + ".lost";
    const std::vector<std::byte> large(600'000, std::byte{7}), huge(3 << 20, std::byte{8});
    const auto begun = [&] {
        auto file = std::make_unique<ArchiveFile>(path, 2);
        file->add_channel("/small", "Small", "float64 x\n");
        file->add_channel("/image", "Image", "uint8[600000] pixels\n", {{"camera", "left"}});
        return file;
    };
    const auto write = [&](ArchiveFile &file, int from, int to) {
        for (int i = from; i < to; i++) {
            const double x = i;
            file.message(1, i, static_cast<std::uint32_t>(i), std::as_bytes(std::span(&x, 1)));
            if (i % 10 == 3) {
                file.message(2, i, 0, i % 20 == 3 ? large : huge); // in chunks, and in one of its own
            }
        }
    };
    const auto bytes_of = [](const std::string &name) {
        std::ifstream in(name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const auto end = [](std::unique_ptr<ArchiveFile> file) {
        file->metadata("end", {{"outcome", "passed"}, {"", ""}});
        file->close();
    };
    const auto made = [&] {
        auto file = begun();
        file->metadata("run", {{"mission", "none"}});
        return file;
    };
    auto whole = made();
    write(*whole, 0, 100);
    end(std::move(whole));
    const std::string expected = bytes_of(path);

    for (const int snapshot : {0, 3, 4, 14, 27, 99}) {
        SCOPED_TRACE(snapshot);
        auto file = made();
        write(*file, 0, snapshot);
        const McapMark mark = file->save();
        write(*file, snapshot, std::min(snapshot + 20, 100)); // what the next program repeats
        file->save();
        const std::string there = bytes_of(part);
        file.reset();
        std::ofstream(part, std::ios::binary) << there; // as a kill leaves it

        McapMark other = mark;
        other.crc++;
        EXPECT_FALSE(ArchiveFile::lost(path, other));
        EXPECT_FALSE(ArchiveFile::lost(path, McapMark{}));
        EXPECT_EQ(bytes_of(part), there);
        for (int killed = 0; killed < 2; killed++) { // as it begins to take over
            EXPECT_TRUE(ArchiveFile::lost(path, mark));
            begun().reset();
        }
        EXPECT_TRUE(ArchiveFile::lost(path, mark));
        auto next = begun();
        next->take_over(mark);
        EXPECT_FALSE(std::filesystem::exists(lost));
        write(*next, snapshot, 100);
        end(std::move(next));
        EXPECT_EQ(bytes_of(path), expected);

        // A finished file has it, too, with metadata that came later.
        std::ofstream(part, std::ios::binary) << expected;
        EXPECT_TRUE(ArchiveFile::lost(path, mark));
        next = begun();
        next->take_over(mark);
        write(*next, snapshot, 100);
        end(std::move(next));
        EXPECT_EQ(bytes_of(path), expected);
    }

    auto file = made();
    write(*file, 0, 10);
    const McapMark mark = file->save();
    file.reset();
    EXPECT_TRUE(ArchiveFile::lost(path, mark));
    ArchiveFile fewer(path, 1);
    fewer.add_channel("/small", "Small", "float64 x\n");
    EXPECT_THAT(error_of([&] { fewer.take_over(mark); }), HasSubstr("taken.mcap"));
    EXPECT_TRUE(std::filesystem::exists(lost)) << "nothing is lost";
    std::remove(lost.c_str());
    std::remove(part.c_str());
}

TEST(Setup, NamesWhatIsWrong)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    auto source = make(flight, "source", source_type);
    auto scale = make(flight, "scale", scale_type);
    auto tank = make(sim.add_process("world"), "tank", tank_type);
    const auto connect = [&](const Port &from, const Port &to) { return error_of([&] { sim.connect(from, to); }); };
    EXPECT_THAT(connect(port(scale, "number"), port(tank, "flow")),
                HasSubstr("flight.scale.number is not an output; flight.scale has product"));
    EXPECT_THAT(connect(port(source, "number"), port(scale, "product")),
                HasSubstr("flight.scale.product is not an input; flight.scale has number and offset"));
    sim.connect(port(source, "number"), port(scale, "offset"));
    EXPECT_THAT(connect(port(tank, "level"), port(scale, "offset")),
                HasSubstr("flight.scale.offset is already written by flight.source.number"));
    EXPECT_THAT(error_of([&] {
                    flight.add_task({"gnc", 0, 0, 0, {scale}});
                }),
                HasSubstr("task flight.gnc: its period must be > 0, found 0 s"));
    EXPECT_THAT(error_of([&] {
                    flight.add_task({"gnc", 10, -3 * ms, 0, {scale}});
                }),
                HasSubstr("its offset must be >= 0, found -0.003 s"));
    EXPECT_THAT(error_of([&] {
                    flight.add_task({"gnc", 10, 0, 0, {tank}});
                }),
                HasSubstr("world.tank, which is not in the process flight; it has source and scale"));
    EXPECT_THAT(error_of([&] { flight.add("source", std::make_shared<Instance>(source_type)); }),
                HasSubstr("flight.source is already there, a Source"));
    EXPECT_THAT(error_of([&] { flight.add("twice", source); }), HasSubstr("already is flight.source"));
    EXPECT_THAT(error_of([&] { flight.add("2nd", std::make_shared<Instance>(source_type)); }),
                HasSubstr("must be an identifier"));
    EXPECT_THAT(error_of([&] { sim.process("fligth"); }), HasSubstr("no process fligth; there are flight and world"));
    const std::string all = error_of([&] { sim.prepare(); });
    EXPECT_THAT(all, HasSubstr("flight.source.value is required: what is put out"));
    EXPECT_THAT(all, HasSubstr("flight.scale is in no task"));
    EXPECT_THAT(all, HasSubstr("flight.scale.number is not wired, nor fed by hand; outputs of its type Number: "
                               "flight.source.number, flight.scale.product and world.tank.level"));
    EXPECT_THAT(all, HasSubstr("world.tank is in no task"));
}

TEST(Setup, ItsProblemsStandByTheLinesThatMadeThem)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    const auto source = std::make_shared<Instance>(source_type), scale = std::make_shared<Instance>(scale_type);
    flight.add("scale", scale, {"flight.py", 9});
    flight.add("source", source, {"flight.py", 4});
    flight.add_task({"gnc", ms, 0, 0, {source}});
    flight.add_mode({"rest", {}, {}, {"gone"}, {"events.py", 30}});
    const auto found = sim.problems();
    ASSERT_EQ(found.size(), 4u);
    EXPECT_EQ(found[0].at, (SourceLine{"events.py", 30}));
    EXPECT_EQ(found[1].at, (SourceLine{"flight.py", 4}));
    EXPECT_EQ(found[1].text, "flight.source.value is required: what is put out");
    EXPECT_EQ(found[2].text, "flight.scale is in no task: name it in the `run` of one, or leave it out");
    EXPECT_EQ(found[3].at, (SourceLine{"flight.py", 9}));
    EXPECT_THAT(
        error_of([&] { sim.prepare(); }),
        HasSubstr("\nflight.py, line 4: flight.source.value is required: what is put out\nflight.py, line 9: "));
    EXPECT_THROW(sim.run_until(0), CompositionError);
    EXPECT_EQ(sim.time(), -1);

    Loop whole;
    EXPECT_TRUE(whole.sim.problems().empty());
    EXPECT_FALSE(whole.sim.prepared()) << "it only looks";
    EXPECT_EQ(whole.sim.clone()->process("flight").find("control")->at, whole.control->at);
}

TEST(Setup, CannotChangeARunningSimulation)
{
    Loop loop;
    loop.sim.run_until(0);
    EXPECT_THAT(error_of([&] { make(loop.sim.process("flight"), "late", source_type); }),
                HasSubstr("the simulation has run until 0 s; reset it before"));
    loop.sim.reset();
    auto late = make(loop.sim.process("flight"), "late", source_type);
    interface<Source>(late).par.value = 1.0;
    loop.sim.connect(port(late, "number"), port(loop.control, "offset"));
    loop.sim.run_until(0);
    EXPECT_EQ(interface<Scale>(loop.control).out.number.x, -0.5 * 8.0 + 1.0);
}

TEST(Setup, StatesAssumptions)
{
    Loop loop;
    EXPECT_TRUE(loop.sim.assumptions().empty());
    interface<Tank>(loop.tank).par.initial = 0.0;
    EXPECT_THAT(loop.sim.assumptions(), ElementsAre("world.tank.initial was left at 0: level at the start"));
    loop.tank->given[2] = true;
    EXPECT_TRUE(loop.sim.assumptions().empty());
}

/// A model with data for 5 ms.
class ShortLived final : public Model {
public:
    void prepare(const Setup &setup) override { name_ = setup.name; }
    void reset(Ns) override {}
    void update(Tick) override {}
    void ensure_data_until(Ns until) override
    {
        if (until > 5 * ms) {
            throw SetupError(name_ + ": data end at 0.005 s, asked for " + std::to_string(until));
        }
    }
    std::vector<std::string> assumptions() const override { return {"data: as good as any"}; }

private:
    std::string name_;
};

TEST(Setup, ARunBeyondAModelsDataIsRefusedBeforeItBegins)
{
    const ModelType short_lived{&tank_interface,
                                [](void *) -> std::unique_ptr<Model> { return std::make_unique<ShortLived>(); }};
    Simulation sim;
    Process &world = sim.add_process("world");
    const auto a = make(world, "a", short_lived), b = make(world, "b", short_lived);
    a->given[2] = b->given[2] = true;
    world.add_task({"all", ms, 0, 0, {a, b}});
    EXPECT_EQ(error_of([&] { sim.run_until(6 * ms); }),
              "world.a: data end at 0.005 s, asked for 6000000\nworld.b: data end at 0.005 s, asked for 6000000");
    EXPECT_EQ(sim.now(), -1);
    EXPECT_THROW(sim.ready_for(6 * ms), SetupError);
    sim.ready_for(5 * ms);
    EXPECT_EQ(sim.now(), -1);
    sim.run_until(5 * ms);
    EXPECT_THROW(sim.step(), SetupError);
    EXPECT_EQ(sim.now(), 5 * ms);
    sim.run_until(5 * ms); // a refused run does no harm
    EXPECT_THAT(sim.assumptions(), ElementsAre("world.a.data: as good as any", "world.b.data: as good as any"));
}

TEST(Pace, FollowsTheWallClockAndStopsWhenAsked)
{
    Loop loop;
    loop.sim.run_until(0);
    const auto start = std::chrono::steady_clock::now();
    EXPECT_TRUE(loop.sim.run_until(2000 * ms, {.pace = 10.0, .poll = {}}));
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(200));
    EXPECT_EQ(loop.sim.pace_report().instants, 20u);
    int polls = 0;
    const auto poll = [&](Ns) { return ++polls < 3; };
    EXPECT_FALSE(loop.sim.run_until(3600'000 * ms, {.pace = 1.0, .poll = poll})) << "asked to stop";
    const Ns there = loop.sim.now();
    EXPECT_LT(there, 3600'000 * ms);
    EXPECT_TRUE(loop.sim.run_until(there + 1000 * ms)) << "and can go on";
    const auto refuse = [](Ns) { return false; };
    EXPECT_FALSE(loop.sim.run_until(1'000'000'000'000 * ms, {.pace = 1e12, .poll = refuse}))
        << "asked to stop, while it is late";
    EXPECT_FALSE(loop.sim.run_until(1'000'000'000'000 * ms, {.poll = refuse})) << "asked to stop, without a pace";
}

} // namespace simulation_test

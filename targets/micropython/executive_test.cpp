// SPDX-License-Identifier: Apache-2.0
// The executive without an interpreter: the tests compose as a script does.
#include "targets/micropython/executive.h"

#include "targets/micropython/arena.h"
#include "targets/micropython/procedure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace {

struct Number {
    Head head;
    double x;
};

struct Adder {
    struct {
        Number a;
    } in;
    struct {
        Number y;
    } out;
    struct {
        double gain;
    } par;
    struct {
        double updates;
    } mem;
};

struct Constant {
    struct {
        Number y;
    } out;
    struct {
        double value;
    } par;
};

struct Mission {
    Number in;
    Constant constant;
    Adder first, second, third;
};

Mission memory;
std::vector<std::string> happened; // names of what was updated, or reset

std::string name_of(const void *module)
{
    return module == &memory.first ? "first" : module == &memory.second ? "second" : "third";
}

void reset_adder(void *self)
{
    auto *m = static_cast<Adder *>(self);
    m->out = {};
    m->mem = {};
    happened.push_back("reset " + name_of(self));
}

void update_adder(void *self, Tick t)
{
    auto *m = static_cast<Adder *>(self);
    m->mem.updates += 1.0;
    m->out.y.x = m->in.a.x + m->par.gain;
    m->out.y.head = head_next(m->out.y.head, t.t, m->in.a.head.quality);
    happened.push_back(name_of(self));
}

void reset_constant(void *self)
{
    static_cast<Constant *>(self)->out = {};
}

void update_constant(void *self, Tick t)
{
    auto *m = static_cast<Constant *>(self);
    m->out.y.x = m->par.value;
    m->out.y.head = head_next(m->out.y.head, t.t, QUALITY_GOOD);
    happened.push_back("constant");
}

constexpr char names[] = "a\0y\0gain\0updates\0value";
enum : std::uint8_t { a = 0, y = 2, gain = 4, updates = 9, value = 17 }; // where they begin

ScriptField field(std::uint16_t name, std::uint8_t type, std::uint8_t group, std::size_t offset)
{
    return {static_cast<std::uint32_t>(offset), name, 0, {}, type, group, 0, 0, 0, SCRIPT_NO_FIELD};
}

const ScriptField adder_fields[] = {field(a, FLEDGE_STRUCT, SCRIPT_IN, offsetof(Adder, in.a)),
                                    field(y, FLEDGE_STRUCT, SCRIPT_OUT, offsetof(Adder, out.y)),
                                    field(gain, FLEDGE_F64, SCRIPT_PAR, offsetof(Adder, par.gain)),
                                    field(updates, FLEDGE_F64, SCRIPT_MEM, offsetof(Adder, mem.updates))};
const ScriptField constant_fields[] = {field(y, FLEDGE_STRUCT, SCRIPT_OUT, offsetof(Constant, out.y)),
                                       field(value, FLEDGE_F64, SCRIPT_PAR, offsetof(Constant, par.value))};
const ScriptType adder{nullptr, "Adder", adder_fields, 4, sizeof(Adder), reset_adder, update_adder};
const ScriptType constant{nullptr, "Constant", constant_fields, 2, sizeof(Constant), reset_constant, update_constant};

constexpr std::uint32_t place_at(std::size_t offset)
{
    return static_cast<std::uint32_t>(offset);
}

/// command_crc of a block of one number.
std::uint16_t crc_of(double x)
{
    std::uint8_t bytes[sizeof x];
    std::memcpy(bytes, &x, sizeof x);
    std::reverse(bytes, bytes + sizeof x);
    return command_crc(bytes, sizeof x);
}

const ScriptPlace places[] = {
    {"constant", &constant, place_at(offsetof(Mission, constant)), offsetof(Constant, par), 0, crc_of(1.5)},
    {"first", &adder, place_at(offsetof(Mission, first)), offsetof(Adder, par), 1, crc_of(10.0)},
    {"second", &adder, place_at(offsetof(Mission, second)), offsetof(Adder, par), 2, crc_of(0.0)},
    {"third", &adder, place_at(offsetof(Mission, third)), offsetof(Adder, par), 3, crc_of(0.0)}};
const ScriptInput inputs[] = {{1, 0, place_at(offsetof(Mission, first.in.a)), sizeof(Number), 30}}; // stale after 30 ns
const ExecRun run[] = {{8, 1}};
const CommandBlock blocks[] = {{run, nullptr, 8, 1, 0, 1, 0},
                               {run, nullptr, 8, 1, 0, 0, 0},
                               {run, nullptr, 8, 1, 0, 0, 0},
                               {run, nullptr, 8, 1, 0, 0, 0}};
std::uint8_t staged[8];
const char *const tasks[] = {"fast", "slow"};
const char *const modes[] = {"idle", "work"};
const char *const events[] = {"settled", "late"};
const char *const processes[] = {"flight", nullptr};

CommandTable commands()
{
    CommandTable table{};
    table.n_blocks = 4;
    table.blocks = blocks;
    table.staged = staged;
    return table;
}

const CommandTable table = commands();

std::function<const char *()> script;
std::uint64_t heap[256];
Arena arena;

} // namespace

const ScriptMission fledge_script = {
    .module = "test.flight",
    .process = "flight",
    .processes = processes,
    .whole = 0,
    .computed = 0,
    .commands = &table,
    .memory = &memory,
    .size = sizeof memory,
    .heap_size = sizeof heap,
    .heap = heap,
    .names = names,
    .field_units = nullptr,
    .enums = nullptr,
    .types = nullptr,
    .places = places,
    .inputs = inputs,
    .constants = nullptr,
    .units = nullptr,
    .unit_texts = nullptr,
    .tasks = tasks,
    .modes = modes,
    .events = events,
    .n_types = 0,
    .n_enums = 0,
    .n_places = 4,
    .n_inputs = 1,
    .n_constants = 0,
    .n_units = 0,
    .n_unit_texts = 0,
    .n_tasks = 2,
    .n_modes = 2,
    .n_events = 2,
};

const char *update_failure()
{
    return nullptr;
}

void update_figures(void (*)(const char *)) {}

int procedures; // how often one had its turn

void procedure_forget() {}
void procedure_end() {}
void procedure_run(std::int64_t)
{
    procedures++;
}

Arena *arena_in_use = &arena;

void *arena_take(size_t n)
{
    void *taken = arena.used + n <= sizeof heap ? reinterpret_cast<std::uint8_t *>(heap) + arena.used : nullptr;
    arena.used += n;
    return taken;
}

const char *process_run()
{
    std::memset(heap, 0, sizeof heap);
    arena = {};
    arena.memory = reinterpret_cast<std::uint8_t *>(heap);
    arena.size = sizeof heap;
    if (!executive_begin()) {
        return "no room";
    }
    return script();
}

namespace {

ExecutiveOperand number(double x)
{
    ExecutiveOperand o{};
    o.of.real = x;
    o.constant = 1;
    return o;
}

ExecutiveOperand element(std::size_t offset)
{
    ExecutiveOperand o{};
    o.of.field = {static_cast<std::uint32_t>(offset), 1};
    return o;
}

std::vector<std::string> described;

/// The composition of a script: constant >> first and second >> third in the task fast, which always runs; the task
/// slow of second in the mode work.
struct Composition {
    std::uint16_t fast_run[2] = {1, 3}, slow_run[1] = {2};
    ExecutiveTask fast{}, slow{};
    ExecutiveTask *working[1] = {&slow};
    ExecutiveMode idle{}, work{};
    ExecutiveWire wires[2]{};
    ExecutiveCondition high{}, low{}, either{}, inverse{};
    ExecutiveEvent settled{}, late{};
    ExecutiveArm arm{};
    ExecutiveSetting setting{};
    double value = 4.0;
    ExecutiveMode *idles[1] = {&idle};

    Composition(const Composition &) = delete; // it points into itself
    Composition()
    {
        fast.name = "fast";
        fast.rate = {10, 0};
        fast.n = 2;
        fast.run = fast_run;
        slow.name = "slow";
        slow.rate = {20, 5};
        slow.n = 1;
        slow.run = slow_run;
        slow.priority = 3;
        idle.name = "idle";
        work.name = "work";
        work.n = 1;
        work.tasks = working;
        wires[0] = {nullptr,
                    offsetof(Mission, constant.out.y),
                    offsetof(Mission, second.in.a),
                    sizeof(Number),
                    5,
                    nullptr,
                    EXEC_SOLE,
                    0};
        wires[1] = {nullptr,
                    offsetof(Mission, first.out.y),
                    offsetof(Mission, third.in.a),
                    sizeof(Number),
                    0,
                    nullptr,
                    EXEC_SOLE,
                    0};
        high.relation = EXEC_GREATER;
        high.of.operands[0] = element(offsetof(Mission, third.out.y.x));
        high.of.operands[1] = number(11.5);
        low.relation = EXEC_LESS;
        low.of.operands[0] = element(offsetof(Mission, third.out.y.x));
        low.of.operands[1] = number(-1.0);
        either.join = EXEC_EITHER;
        either.of.parts[0] = &low;
        either.of.parts[1] = &high;
        settled.name = "settled";
        settled.when = &either;
        settled.count = 2;
        settled.armed = 1;
        settled.once = 1;
        settled.n_modes = 1;
        settled.modes = idles;
        settled.enter = &work;
        settled.arms = &arm;
        arm.name = "late";
        arm.on = 1;
        late.name = "late";
        late.when = &high;
        late.count = 1;
        late.settings = &setting;
        setting = {nullptr, offsetof(Mission, constant.par.value), sizeof value,
                   reinterpret_cast<const std::uint8_t *>(&value)};
    }

    const char *compose()
    {
        for (std::uint16_t i = 0; i < 4; i++) {
            executive_name(i);
        }
        memory.constant.par.value = 1.5;
        memory.first.par.gain = 10.0;
        executive_changed(0); // while it composes: not for the first instant
        executive_add_wire(&wires[0]);
        executive_add_wire(&wires[1]);
        executive_add_task(&fast);
        executive_add_task(&slow);
        executive_add_mode(&idle);
        executive_add_mode(&work);
        executive_add_event(&settled);
        executive_add_event(&late);
        return nullptr;
    }
};

class Composed : public testing::Test {
protected:
    void SetUp() override
    {
        script = [this] { return made->compose(); };
        executive_init();
        ASSERT_EQ(executive_failure(), nullptr) << executive_failure();
        happened.clear();
    }

    /// The next tick, with a number from outside. Returns its time.
    static std::int64_t tick(double x)
    {
        const std::int64_t t = executive_next();
        memory.in = {{t, QUALITY_GOOD, 1}, x};
        happened.clear();
        executive_tick(t);
        return t;
    }

    std::unique_ptr<Composition> made = std::make_unique<Composition>();
};

using Names = std::vector<std::string>;

TEST_F(Composed, ResetsAllAndPublishesItsConfigurationAtTheStart)
{
    EXPECT_EQ(memory.constant.out.y.x, 1.5);
    EXPECT_EQ(memory.second.in.a.x, 1.5) << "carried when it is published";
    EXPECT_EQ(memory.second.in.a.head.sequence, 1u);
    EXPECT_EQ(executive_next(), 0);
    EXPECT_EQ(executive_mode(), 0);
    EXPECT_EQ(arena.locked, 1);
}

TEST_F(Composed, CarriesTheWiresOfAModuleBeforeItsUpdate)
{
    EXPECT_EQ(tick(1.0), 0);
    EXPECT_EQ(happened, (Names{"first", "third"}));
    EXPECT_EQ(memory.third.out.y.x, 11.0);
    EXPECT_EQ(tick(0.5), 10);
    EXPECT_EQ(memory.third.out.y.x, 10.5);
    EXPECT_EQ(memory.third.out.y.head.quality, QUALITY_GOOD);
}

TEST_F(Composed, AgesWhatComesFromOutside)
{
    tick(1.0);
    const std::int64_t t = executive_next();
    memory.in.head.t = t - 31;
    executive_tick(t);
    EXPECT_EQ(memory.first.in.a.head.quality, QUALITY_STALE);
    EXPECT_EQ(memory.in.head.quality, QUALITY_GOOD) << "only the reader's";
    EXPECT_EQ(memory.first.out.y.head.quality, QUALITY_STALE);
}

TEST_F(Composed, EntersAModeAtTheNextTickAndResetsWhatBecomesActive)
{
    tick(1.0);
    executive_enter(1);
    EXPECT_EQ(executive_mode(), 0) << "not yet";
    EXPECT_EQ(executive_next(), 5) << "the task of the requested mode";
    EXPECT_EQ(tick(1.0), 5);
    EXPECT_EQ(happened, (Names{"reset second", "second"}));
    EXPECT_EQ(executive_mode(), 1);
    EXPECT_EQ(memory.second.out.y.x, 1.5);
    executive_enter(0);
    EXPECT_EQ(tick(1.0), 10);
    EXPECT_EQ(happened, (Names{"first", "third"}));
    EXPECT_EQ(tick(1.0), 20);
    executive_enter(7); // there is none
    EXPECT_EQ(executive_next(), 30);
}

TEST_F(Composed, AnEventDoesNotEnterAModeWhoseConditionDoesNotHold)
{
    static const char *others[] = {"work"};
    made = std::make_unique<Composition>();
    made->settled.once = 0;
    made->idle.n_after = 1;
    made->idle.after = others;
    made->work.when = &made->inverse;
    made->inverse.join = EXEC_INVERSE;
    made->inverse.of.parts[0] = &made->high;
    executive_init();
    EXPECT_FALSE(executive_may_enter(0)) << "it is in it";
    EXPECT_TRUE(executive_may_enter(1));
    for (const double x : {2.0, 2.0, 2.0}) { // high holds
        tick(x);
    }
    EXPECT_EQ(made->settled.state.fired_at, 10);
    EXPECT_EQ(made->settled.state.refused, 1);
    EXPECT_EQ(executive_mode(), 0);
    EXPECT_FALSE(executive_may_enter(1));
    for (const double x : {0.0, -20.0, -20.0, -20.0}) { // low holds
        tick(x);
    }
    EXPECT_EQ(made->settled.state.refused, 0);
    EXPECT_EQ(executive_mode(), 1);
    EXPECT_TRUE(executive_may_enter(0));
    described.clear();
    executive_describe([](const char *text) { described.emplace_back(text); });
    for (const char *line :
         {"follows idle work", "guards work third+40:element > 0x4027000000000000", "guards work ~"}) {
        EXPECT_EQ(std::count(described.begin(), described.end(), line), 1) << line;
    }
}

TEST_F(Composed, RunsTasksOfHigherPriorityFirst)
{
    made->slow.rate.offset = 0;
    executive_enter(1);
    tick(1.0);
    EXPECT_EQ(happened, (Names{"reset second", "second", "first", "third"}));
}

TEST_F(Composed, RunsTasksOfEqualPriorityInTheirOrder)
{
    made = std::make_unique<Composition>();
    made->slow.priority = 0;
    made->slow.rate.offset = 0;
    executive_init();
    executive_enter(1);
    tick(1.0);
    EXPECT_EQ(happened, (Names{"reset second", "first", "third", "second"}));
}

TEST_F(Composed, FindsTheNextTimeOfATaskOfTheRequestedMode)
{
    made = std::make_unique<Composition>();
    made->fast.rate.offset = 3;
    made->slow.rate.offset = 0;
    executive_init();
    executive_enter(1);
    EXPECT_EQ(executive_next(), 0) << "before the first tick";
    executive_enter(0);
    EXPECT_EQ(tick(1.0), 3);
    EXPECT_EQ(tick(1.0), 13);
    executive_enter(1);
    EXPECT_EQ(executive_next(), 20) << "not a time that is past";
}

TEST_F(Composed, AnEventWaitsUntilItsOtherConditionHolds)
{
    made = std::make_unique<Composition>();
    made->settled.once = 0;
    made->settled.until = &made->low;
    executive_init();
    for (const double x : {2.0, 2.0, 0.0, 2.0, 2.0}) {
        tick(x);
    }
    EXPECT_EQ(made->settled.state.fired_at, 10);
    EXPECT_EQ(made->settled.state.armed, -1);
    executive_enter(0);
    for (const double x : {-20.0, 2.0, 2.0}) {
        tick(x);
    }
    EXPECT_EQ(made->settled.state.fired_at, 60);
}

TEST_F(Composed, FiresItsEventsInOrder)
{
    tick(1.0);
    tick(2.0);
    EXPECT_EQ(executive_mode(), 0);
    tick(2.0);
    EXPECT_EQ(made->settled.state.fired_at, 20) << "at the second instant";
    EXPECT_EQ(made->late.state.fired_at, 20) << "armed by the event before it, at once";
    EXPECT_EQ(happened, (Names{"first", "third", "constant"})) << "a setting of configuration publishes it";
    EXPECT_EQ(memory.second.in.a.x, 4.0);
    EXPECT_EQ(executive_mode(), 0);
    tick(0.0);
    EXPECT_EQ(executive_mode(), 1);
    EXPECT_EQ(made->settled.state.armed, 0) << "once";
}

TEST_F(Composed, LooksAtEventsOnlyInTheirModesAndWhenATaskRan)
{
    executive_enter(1);
    tick(2.0);
    tick(2.0);
    tick(2.0);
    EXPECT_EQ(made->settled.state.fired_at, -1);
    executive_enter(0);
    const int before = procedures;
    executive_tick(executive_next());
    executive_tick(executive_next() - 1); // nothing is due
    EXPECT_EQ(made->settled.state.held, 1);
    EXPECT_EQ(procedures, before + 1);
}

TEST_F(Composed, CommandsAndTheScriptPublishConfiguration)
{
    memory.constant.par.value = 7.0;
    executive_publish(0, 3);
    EXPECT_EQ(memory.second.in.a.x, 7.0);
    executive_publish(1, 3);
    executive_changed(1);
    EXPECT_EQ(happened, (Names{"constant"})) << "a module of a task publishes nothing";
    memory.constant.par.value = 8.0;
    executive_changed(0);
    EXPECT_EQ(memory.second.in.a.x, 7.0);
    tick(1.0);
    EXPECT_EQ(happened, (Names{"constant", "first", "third"}));
    EXPECT_EQ(memory.second.in.a.x, 8.0);
    executive_arm(1, 1);
    EXPECT_EQ(made->late.state.armed, 1);
    EXPECT_EQ(executive_parameters(1), &memory.first.par);
}

TEST_F(Composed, BeginsAgainAtATimeWithItsParameters)
{
    tick(2.0);
    tick(2.0);
    executive_enter(1);
    tick(2.0);
    memory.first.par.gain = 20.0;
    executive_restart(47);
    EXPECT_EQ(executive_next(), 50);
    EXPECT_EQ(executive_mode(), 0);
    EXPECT_EQ(memory.in.head.sequence, 0u);
    EXPECT_EQ(memory.third.in.a.x, 0.0);
    EXPECT_EQ(memory.first.mem.updates, 0.0);
    EXPECT_EQ(memory.first.par.gain, 20.0);
    EXPECT_EQ(made->settled.state.held, 0);
    EXPECT_EQ(made->late.state.armed, 0);
    EXPECT_EQ(memory.constant.out.y.head.t, 47);
}

TEST_F(Composed, ItsOwnFunctionsReplaceThoseOfAType)
{
    ExecutiveModule &module = executive.modules[1];
    module.update = [](void *self, Tick t) { *static_cast<int *>(self) += static_cast<int>(t.t) + 1; };
    module.reset = [](void *self) { ++*(static_cast<int *>(self) + 1); };
    int counts[2] = {};
    module.self = counts;
    executive_restart(0);
    tick(1.0);
    tick(1.0);
    EXPECT_EQ(counts[0], 12);
    EXPECT_EQ(counts[1], 1);
}

TEST_F(Composed, DescribesWhatWasComposed)
{
    described.clear();
    executive_describe([](const char *text) { described.emplace_back(text); });
    const auto has = [](const std::string &line) { return std::count(described.begin(), described.end(), line) == 1; };
    for (const char *line :
         {"module constant Constant", "wire constant.y second.a 0", "wire first.y third.a 0", "task slow 20 5 3",
          "runs fast third", "activates work slow", "start idle", "event settled 0 2 1 1", "looks settled idle",
          "enters settled work", "arms settled late", "sets late constant+24 0000000000001040",
          "when settled third+40:element < 0xbff0000000000000", "when settled |",
          "when late third+40:element > 0x4027000000000000",
          "bytes first 32 0000000000000000000000000000000000000000000024400000000000000000"}) {
        EXPECT_TRUE(has(line)) << line;
    }
    for (const std::string &line : described) {
        EXPECT_TRUE(line.find("bytes third") != 0 && line.find("differs") != 0) << line;
    }
    EXPECT_NE(described.back().find("heap "), std::string::npos);
}

TEST_F(Composed, NamesParametersThatDifferFromTheDesktops)
{
    script = [this] {
        const char *why = made->compose();
        memory.first.par.gain = 10.000000000000002;
        return why;
    };
    made = std::make_unique<Composition>();
    executive_init();
    described.clear();
    executive_describe([](const char *text) { described.emplace_back(text); });
    EXPECT_EQ(std::count(described.begin(), described.end(), "differs first"), 1);
    const std::string text(reinterpret_cast<const char *>(executive_texts.memory) + sizeof(TelemetryText),
                           executive_texts.used - sizeof(TelemetryText));
    EXPECT_EQ(text, "flight.first: its parameters are not those of the desktop");
}

TEST_F(Composed, StartsAnewAfterAResetOfTheComputer)
{
    tick(2.0);
    executive_enter(1);
    tick(2.0);
    made = std::make_unique<Composition>();
    executive_init();
    EXPECT_EQ(executive_failure(), nullptr);
    EXPECT_EQ(executive_next(), 0);
    EXPECT_EQ(tick(1.0), 0);
    EXPECT_EQ(memory.third.out.y.x, 11.0);
}

/// Why a composition is refused, that a function has changed.
std::string refusal(const std::function<void(Composition &)> &change)
{
    Composition made;
    change(made);
    script = [&] { return made.compose(); };
    executive_init();
    executive_tick(0); // flies nothing, and does no harm
    executive_restart(5);
    executive_enter(1);
    executive_arm(0, 1);
    executive_publish(0, 5);
    executive_changed(0);
    EXPECT_EQ(executive_next(), INT64_MAX);
    described.clear();
    executive_describe([](const char *text) { described.emplace_back(text); });
    return executive_failure() ? executive_failure() : "";
}

TEST(Refused, WhatIsNotTheMissionAsItWasExported)
{
    EXPECT_EQ(refusal([](Composition &c) { c.work.name = "rest"; }),
              "the script does not make, at its place, the mode flight.rest, unlike the mission as it was exported: "
              "export it again");
    EXPECT_NE(refusal([](Composition &c) { c.slow.name = "slower"; }).find("other tasks than flight.slow"),
              std::string::npos);
    EXPECT_NE(refusal([](Composition &c) { c.settled.name = "early"; }).find("the event flight.early"),
              std::string::npos);
    EXPECT_EQ(refusal([](Composition &c) { c.arm.name = "nothing"; }),
              "event flight.settled arms nothing, which is not there");
    EXPECT_EQ(refusal([](Composition &c) { c.fast.n = 1; }), "flight.third is in no task");
}

TEST(Refused, AScriptThatFails)
{
    script = [] { return "flight.py, line 3: SetupError: no"; };
    executive_init();
    EXPECT_STREQ(executive_failure(), "flight.py, line 3: SetupError: no");
    EXPECT_EQ(executive_next(), INT64_MAX);
}

} // namespace

// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace simulation_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Process, RefusesWhatCannotBeATask)
{
    Loop loop;
    Process &world = loop.sim.process("world");
    const auto first = make(world, "one", source_type), second = make(world, "two", source_type);
    const auto refused = [&](const Task &task, const std::string &why) {
        EXPECT_EQ(error_of([&] { world.add_task(task); }), "task world." + task.name + why);
    };
    refused({"a", 0, 0, 0, {first}}, ": its period must be at least 1 ns, found 0 s");
    refused({"a", -1, 0, 0, {first}}, ": its period must be at least 1 ns, found -0.000000001 s");
    refused({"a", 1, -1, 0, {first}}, ": its offset must be >= 0, found -0.000000001 s");
    refused({"a", 1, 0, 0, {}}, " runs nothing");
    refused({"a", 1, 0, 0, {first, second, first}}, " runs world.one, which is already in task world.a");
    refused({"a", 1, 0, 0, {first, loop.tank}}, " runs world.tank, which is already in task world.dynamics");
    refused({"a", 1, 0, 0, {loop.control}}, " runs flight.control, which is not in the process world; it has tank, "
                                            "one and two");
    EXPECT_EQ(error_of([&] { world.add_task({"a", 1, 0, 0, {first, second}}); }), "");
    refused({"a", 1, 0, 0, {first}}, " is already there");
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
                HasSubstr("task flight.gnc: its period must be at least 1 ns, found 0 s"));
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

} // namespace simulation_test

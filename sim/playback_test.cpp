// SPDX-License-Identifier: Apache-2.0
#include "sim/batch.h"
#include "sim/simulation.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

namespace playback_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::HasSubstr;

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
    const auto level = [](Simulation &flown) {
        return interface<Tank>(flown.process("world").find("tank")).out.level.x;
    };
    for (Simulation *flown : {&sim, sim.clone().release()}) {
        flown->run_until(1000 * ms);
        EXPECT_NEAR(level(*flown), 8.0 + 2.0, 1e-12);
        Scale &played = interface<Scale>(flown->process("flight").find("scale"));
        EXPECT_EQ(played.in.number.x, level(*flown)); // what flows in is the world's; the initial mode runs no task
        EXPECT_EQ(played.mem.updates, 0);
        played.par.gain = 7.0;
        flown->process("flight").enter("control");
        flown->run_until(2000 * ms);
        EXPECT_EQ(flown->process("flight").mode(), "control");
        EXPECT_NEAR(level(*flown), 8.0 + 2.0 - 3.0, 1e-12);
        if (flown != &sim) {
            delete flown;
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

/// What a Scale does, as a model with a memory of its own.
class Computer final : public Model {
public:
    explicit Computer(void *interface) : scale_(*static_cast<Scale *>(interface)) {}
    void prepare(const Setup &) override {}
    void refresh() override { gain_ = scale_.par.gain; }
    void reset(Ns) override
    {
        refresh();
        scale_.out.number = {};
    }
    void update(Tick tick) override
    {
        scale_.out.number = {head_next(scale_.out.number.head, tick.t, QUALITY_GOOD), gain_ * scale_.in.number.x};
    }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span{&gain_, 1}); }

private:
    Scale &scale_;
    double gain_ = 0.0;
};

TEST(Playback, AModelFliesInPlaceOfTheModulesWithTheirInputsParametersAndSnapshots)
{
    const ModelType type{
        &scale_type, [](void *interface) -> std::unique_ptr<Model> { return std::make_unique<Computer>(interface); }};
    const auto fly = [&](bool by_model) {
        Simulation sim;
        Process &world = sim.add_process("world");
        Process &flight = sim.add_process("flight");
        auto scale = make(flight, "scale", scale_type);
        auto tank = make(world, "tank", tank_type);
        interface<Scale>(scale).par.gain = -0.5;
        interface<Tank>(tank).par.initial = 1.0;
        flight.add_task({"gnc", 500 * ms, 0, 0, {scale}});
        world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
        sim.connect(port(tank, "level"), port(scale, "number"));
        sim.connect(port(scale, "product"), port(tank, "flow"));
        auto computer = std::make_shared<Instance>(type);
        if (by_model) {
            const std::vector<Shared> shared{{port(scale, "number"), offsetof(Scale, in.number)},
                                             {port(scale, "gain"), offsetof(Scale, par.gain)},
                                             {port(scale, "product"), offsetof(Scale, out.number)}};
            EXPECT_THAT(error_of([&] {
                            flight.fly_by_model("other", computer, {{shared[0].port, sizeof(Scale)}});
                        }),
                        HasSubstr("flight.scale.number has no place in the computer that flies flight"));
            flight.fly_by_model("computer", computer, shared);
        }
        sim.run_until(1000 * ms);
        interface<Scale>(scale).par.gain = -0.25;
        sim.run_until(2000 * ms);
        const auto snapshot = sim.snapshot();
        sim.run_until(4000 * ms);
        const double first = interface<Tank>(tank).out.level.x;
        interface<Scale>(scale).par.gain = 7.0; // what was set before the snapshot is back after it
        sim.run_until(5000 * ms);
        sim.restore(snapshot);
        sim.run_until(4000 * ms);
        EXPECT_EQ(interface<Tank>(tank).out.level.x, first);
        sim.restore(snapshot);
        const auto clone = sim.clone();
        sim.run_until(2500 * ms); // the clone has a computer of its own
        clone->run_until(4000 * ms);
        sim.run_until(4000 * ms);
        EXPECT_EQ(interface<Tank>(clone->process("world").find("tank")).out.level.x, first);
        EXPECT_EQ(interface<Scale>(scale).mem.updates, by_model ? 0 : 9);
        return std::pair{first, interface<Scale>(scale).out.number.head.sequence};
    };
    EXPECT_EQ(fly(true), fly(false));
}

TEST(Playback, AnActionOfABatchCountsBeforeTheComputerFlies)
{
    const ModelType type{
        &scale_type, [](void *interface) -> std::unique_ptr<Model> { return std::make_unique<Computer>(interface); }};
    Simulation sim;
    Process &world = sim.add_process("world"), &flight = sim.add_process("flight");
    auto scale = make(flight, "scale", scale_type);
    auto tank = make(world, "tank", tank_type);
    interface<Scale>(scale).par.gain = 9.0;
    interface<Tank>(tank).par.initial = 8.0;
    flight.add_task({"gnc", 500 * ms, 0, 0, {scale}});
    world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
    sim.connect(port(tank, "level"), port(scale, "number"));
    sim.connect(port(scale, "product"), port(tank, "flow"));
    flight.fly_by_model("computer", std::make_shared<Instance>(type),
                        {{port(scale, "number"), offsetof(Scale, in.number)},
                         {port(scale, "gain"), offsetof(Scale, par.gain)},
                         {port(scale, "product"), offsetof(Scale, out.number)}});
    BatchPlan plan;
    plan.clones = 1;
    plan.every = 500 * ms;
    plan.actions = {{"flight.scale", offsetof(Scale, par.gain), FLEDGE_F64, {"flight.scale.gain"}}};
    plan.observations = {{"world.tank", offsetof(Tank, out.level.x), FLEDGE_F64, {"world.tank.level.x"}}};
    Batch batch(sim, plan);
    ASSERT_TRUE(batch.reset(std::vector<std::size_t>{0}, std::vector<BatchRun>{{1, 0}}));
    std::vector<double> seen(1);
    double level = 8.0;
    for (const double gain : {-0.5, 0.25, -1.0, 0.0}) { // x' = gain x(begin) in each step
        level += 0.5 * gain * level;
        ASSERT_TRUE(batch.step(std::vector{gain}, seen));
        EXPECT_NEAR(seen[0], level, 1e-12);
    }
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

} // namespace playback_test

// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <map>

namespace snapshot_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

} // namespace snapshot_test

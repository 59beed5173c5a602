// SPDX-License-Identifier: Apache-2.0
#include "sim/batch.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace batch_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::DoubleNear;
using ::testing::HasSubstr;
using ::testing::Pointwise;

constexpr Ns second = 1'000'000'000;

/// The loop, and plans of batches of it.
struct Nominal : Loop {
    /// Clones that get a flow and show their level.
    BatchPlan plan(std::size_t clones, unsigned threads = 1)
    {
        BatchPlan plan;
        plan.clones = clones;
        plan.threads = threads;
        plan.every = second / 2;
        plan.actions = {{"world.tank", offsetof(Tank, in.flow.x), FLEDGE_F64, {"world.tank.flow.x"}}};
        plan.observations = {{"world.tank", offsetof(Tank, out.level.x), FLEDGE_F64, {"world.tank.level.x"}}};
        return plan;
    }
};

void begin(Batch &batch)
{
    std::vector<std::size_t> all(batch.clones());
    std::iota(all.begin(), all.end(), std::size_t{0});
    std::vector<BatchRun> runs(all.size());
    for (std::size_t i : all) {
        runs[i] = {7, i};
    }
    EXPECT_TRUE(batch.reset(all, runs));
}

Dispersion levels(double low, double high)
{
    Dispersion level{"world.tank.initial", {0}, {}};
    level.distribution.a = low;
    level.distribution.b = high;
    return level;
}

TEST(Batch, EachCloneIntegratesItsOwnActions)
{
    Nominal nominal;
    for (unsigned threads : {1u, 2u, 5u}) {
        Batch batch(nominal.sim, nominal.plan(37, threads));
        begin(batch);
        std::vector<double> actions(37), observed(37);
        std::vector<double> expected(37, 8.0);
        for (int step = 1; step <= 20; step++) {
            for (std::size_t i = 0; i < 37; i++) {
                actions[i] = std::ldexp(static_cast<double>(i), -3) - 2.0;
                expected[i] += 0.5 * actions[i];
            }
            ASSERT_TRUE(batch.step(actions, observed));
            for (std::size_t i = 0; i < 37; i++) {
                EXPECT_NEAR(observed[i], expected[i], 1e-12);
                EXPECT_EQ(batch.time(i), step * second / 2);
            }
        }
    }
    EXPECT_EQ(nominal.sim.time(), -1) << "the original is left alone";
    EXPECT_EQ(nominal.sim.wires().size(), 2u);
}

TEST(Batch, AnActionInAnOutputReachesEachInputThatItFeeds)
{
    Nominal nominal;
    BatchPlan plan = nominal.plan(1);
    plan.actions = {{"flight.control", offsetof(Scale, out.number.x), FLEDGE_F64, {"flight.control.product.x"}}};
    plan.observations.push_back(
        {"flight.control", offsetof(Scale, out.number.x), FLEDGE_F64, {"flight.control.product.x"}});
    Batch batch(nominal.sim, plan);
    begin(batch);
    std::vector<double> observed(2);
    ASSERT_TRUE(batch.step(std::vector{-4.0}, observed));
    EXPECT_THAT(observed, Pointwise(DoubleNear(1e-12), {6.0, -3.0})); // the controller goes on, and nothing reads it
}

TEST(Batch, AnActionInAParameterChangesIt)
{
    Nominal nominal;
    BatchPlan plan = nominal.plan(2);
    plan.actions = {{"flight.control", offsetof(Scale, par.gain), FLEDGE_F64, {"flight.control.gain"}}};
    Batch batch(nominal.sim, plan);
    begin(batch);
    std::vector<double> observed(2);
    // A gain counts at the instant at which it is given: x' = gain x for half a second, from 8.
    ASSERT_TRUE(batch.step(std::vector{-1.0, 0.0}, observed));
    EXPECT_THAT(observed, Pointwise(DoubleNear(1e-12), {4.0, 8.0}));
    ASSERT_TRUE(batch.step(std::vector{-0.5, -1.0}, observed));
    EXPECT_THAT(observed, Pointwise(DoubleNear(1e-12), {3.0, 4.0}));
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{0}, std::vector<BatchRun>{{7, 0}}));
    EXPECT_EQ(interface<Scale>(batch.clone(0).processes()[1]->instances()[0]).par.gain, -0.5)
        << "the nominal one again";
    ASSERT_TRUE(batch.step(std::vector{1.0, 0.0}, observed));
    EXPECT_THAT(observed, Pointwise(DoubleNear(1e-12), {12.0, 4.0}));
}

/// What flight does with the level, in three modules: the first is observed, the last commands the tank. With
/// feedback, the first one adds what the second one put out at the instant before.
struct Chain {
    explicit Chain(bool feedback = false, Ns offset = 0)
    {
        Process &world = sim.add_process("world"), &flight = sim.add_process("flight");
        const auto tank = make(world, "tank", tank_type);
        interface<Tank>(tank).par.initial = 8.0;
        const auto sense = make(flight, "sense", scale_type), law = make(flight, "law", scale_type),
                   valve = make(flight, "valve", scale_type);
        interface<Scale>(sense).par.gain = 0.25;
        interface<Scale>(law).par.gain = -1.5;
        interface<Scale>(valve).par.gain = 2.0;
        world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
        flight.add_task({"gnc", 500 * ms, offset, 0, {sense, law, valve}});
        sim.connect(port(tank, "level"), port(sense, "number"));
        sim.connect(port(sense, "product"), port(law, "number"));
        sim.connect(port(law, "product"), port(valve, "number"));
        sim.connect(port(valve, "product"), port(tank, "flow"));
        if (feedback) {
            sim.connect(port(law, "product"), port(sense, "offset"));
        }
    }
    /// Clones whose law is outside: they show what the first module senses, the level, and the valve's flow.
    static BatchPlan plan(Ns every = second / 2, std::size_t delay = 0)
    {
        BatchPlan plan;
        plan.clones = 2;
        plan.every = every;
        plan.delay = delay;
        plan.actions = {{"flight.law", offsetof(Scale, out.number.x), FLEDGE_F64, {"flight.law.product.x"}}};
        plan.observations = {{"flight.sense", offsetof(Scale, out.number.x), FLEDGE_F64, {"sensed"}},
                             {"world.tank", offsetof(Tank, out.level.x), FLEDGE_F64, {"level"}},
                             {"flight.valve", offsetof(Scale, out.number.x), FLEDGE_F64, {"flow"}}};
        return plan;
    }
    Simulation sim;
};

TEST(Batch, ALawOutsideFliesTheBitsOfTheLawInside)
{
    const auto memory = [](const Simulation &sim, std::size_t process, std::size_t instance) {
        const auto &found = sim.processes()[process]->instances()[instance];
        return std::vector(found->memory(), found->memory() + found->type().size);
    };
    for (const auto &[feedback, offset] : {std::pair<bool, Ns>{false, 0}, {true, 0}, {false, 300 * ms}}) {
        Chain chain(feedback, offset);
        BatchPlan plan = Chain::plan();
        plan.threads = feedback ? 2 : 1;
        Batch batch(chain.sim, plan);
        begin(batch);
        std::vector<double> seen(6);
        batch.observe(seen);
        EXPECT_EQ(seen[0], 2.0) << "of the first instant of flight, before any action";
        EXPECT_EQ(batch.time(0), offset);
        const auto inside = chain.sim.clone();
        inside->run_until(offset);
        for (int k = 0; k < 60; k++) {
            ASSERT_TRUE(batch.step(std::vector{-1.5 * seen[0], -1.5 * seen[3]}, seen));
            for (std::size_t i = 0; i < 2; i++) {
                EXPECT_EQ(memory(batch.clone(i), 1, 2), memory(*inside, 1, 2)) << "the valve at " << k;
            }
            inside->run_until((k + 1) * second / 2 + offset);
            for (std::size_t i = 0; i < 2; i++) {
                EXPECT_EQ(memory(batch.clone(i), 0, 0), memory(*inside, 0, 0)) << "the tank at " << k + 1;
                EXPECT_EQ(memory(batch.clone(i), 1, 0), memory(*inside, 1, 0)) << "what is sensed at " << k + 1;
                EXPECT_EQ(batch.clone(i).time(), inside->time());
            }
        }
    }
}

TEST(Batch, AnActionCountsAtTheInstantThatWasObserved)
{
    Chain chain;
    // By hand: the valve's flow is twice the action, from the instant k on, and the level its integral.
    for (const std::size_t delay : {0u, 1u, 2u, 5u}) {
        for (const int periods : {1, 2, 3}) { // in a step
            Batch batch(chain.sim, Chain::plan(periods * second / 2, delay));
            begin(batch);
            std::vector<double> seen(6), given;
            double level = 8.0;
            for (int k = 0; k < 12; k++) {
                given.push_back(0.25 * (k + 1) * (k % 3 - 1));
                ASSERT_TRUE(batch.step(std::vector{given.back(), 0.0}, seen));
                for (int i = k * periods; i < (k + 1) * periods; i++) {
                    const int arrived = i - static_cast<int>(delay);
                    level += 0.5 * 2.0 * (arrived < 0 ? 0.0 : given[static_cast<std::size_t>(arrived / periods)]);
                }
                EXPECT_NEAR(seen[1], level, 1e-12) << delay << " " << periods << " " << k;
                EXPECT_NEAR(seen[0], 0.25 * level, 1e-12) << "flight has seen this instant";
                EXPECT_NEAR(seen[4], 8.0, 1e-12);
            }
        }
    }
}

TEST(Batch, AMessageOnItsWayKeepsTheTimeAtWhichItWasMade)
{
    Chain chain;
    Batch batch(chain.sim, Chain::plan(second, 3));
    begin(batch);
    std::vector<double> seen(6);
    ASSERT_TRUE(batch.step(std::vector{1.0, 1.0}, seen));
    const auto valve = [&] { return interface<Scale>(batch.clone(0).processes()[1]->instances()[2]).in.number; };
    EXPECT_EQ(valve().head.quality, QUALITY_NONE) << "nothing has arrived";
    ASSERT_TRUE(batch.step(std::vector{2.0, 2.0}, seen));
    EXPECT_EQ(valve().x, 1.0);
    EXPECT_EQ(valve().head.t, 0);
    ASSERT_TRUE(batch.step(std::vector{3.0, 3.0}, seen));
    EXPECT_EQ(valve().x, 2.0);
    EXPECT_EQ(valve().head.t, second);
    EXPECT_EQ(valve().head.sequence, 2u);
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{0}, std::vector<BatchRun>{{7, 0}}));
    ASSERT_TRUE(batch.step(std::vector{4.0, 4.0}, seen));
    EXPECT_EQ(valve().head.quality, QUALITY_NONE) << "what was on its way is gone";
}

TEST(Batch, WhatRunsBehindTheActionsIsLate)
{
    Chain chain;
    BatchPlan plan = Chain::plan();
    plan.observations.push_back({"flight.valve", offsetof(Scale, par.gain), FLEDGE_F64, {"gain"}});
    plan.observations.push_back({"flight.law", offsetof(Scale, out.number.x), FLEDGE_F64, {"law"}});
    const auto late = [&] {
        const Batch batch(chain.sim, plan);
        std::string found;
        for (std::size_t i = 0; i < plan.observations.size(); i++) {
            found += batch.is_late(i) ? '1' : '0';
        }
        return found;
    };
    EXPECT_EQ(late(), "00100") << "only the valve: its gain is no message, and the law that is replaced still runs";
    plan.actions[0] = {"flight.law", offsetof(Scale, par.gain), FLEDGE_F64, {"gain"}};
    EXPECT_EQ(late(), "00101");
    plan.actions[0] = {"world.tank", offsetof(Tank, in.flow.x), FLEDGE_F64, {"flow"}};
    EXPECT_EQ(late(), "00000") << "a model reads it at its next instant";
}

TEST(Batch, ACopyInTheMiddleOfAnInstantGoesOnFromThere)
{
    Chain chain;
    Batch batch(chain.sim, Chain::plan());
    begin(batch);
    std::vector<double> seen(6);
    ASSERT_TRUE(batch.step(std::vector{-1.0, 1.0}, seen));
    const auto copy = batch.copy(0);
    EXPECT_EQ(copy->time(), second / 2);
    EXPECT_EQ(copy->snapshot(), batch.clone(0).snapshot());
    // From its snapshot, another clone does what the first one does.
    const auto snapshot = copy->snapshot();
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{1}, std::vector<BatchRun>{{7, 0}}, snapshot));
    EXPECT_EQ(batch.time(1), second / 2);
    ASSERT_TRUE(batch.step(std::vector{-2.0, -2.0}, seen));
    EXPECT_EQ(seen[0], seen[3]);
    EXPECT_EQ(seen[1], seen[4]);
    EXPECT_NEAR(seen[1], 8.0 - 1.0 - 2.0, 1e-12);
    EXPECT_EQ(batch.clone(0).snapshot(), batch.clone(1).snapshot());
    // The copy runs the rest of its instant with the action that it had, and goes on with it.
    copy->run_until(second);
    EXPECT_NEAR(interface<Tank>(copy->processes()[0]->instances()[0]).out.level.x, 8.0 - 1.0 - 1.0, 1e-12);
    EXPECT_EQ(interface<Scale>(copy->processes()[1]->instances()[2]).mem.updates, 3);
}

TEST(Batch, FromASnapshotOfAWholeInstantItRunsToOneAtWhichAnActionCounts)
{
    Chain chain;
    chain.sim.run_until(second + 100 * ms);
    const auto snapshot = chain.sim.snapshot();
    const auto inside = chain.sim.clone();
    Batch batch(chain.sim, Chain::plan());
    begin(batch);
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{0}, std::vector<BatchRun>{{7, 0}}, snapshot));
    EXPECT_EQ(batch.time(0), 3 * second / 2);
    std::vector<double> seen(6);
    for (int k = 3; k < 10; k++) {
        batch.observe(seen);
        inside->run_until(k * second / 2);
        EXPECT_EQ(seen[1], interface<Tank>(inside->processes()[0]->instances()[0]).out.level.x);
        ASSERT_TRUE(batch.step(std::vector{-1.5 * seen[0], 0.0}, seen));
    }
}

TEST(Batch, AWireWithLatencyKeepsIt)
{
    Chain chain;
    Simulation sim;
    Process &first = sim.add_process("first"), &second_one = sim.add_process("second");
    const auto law = make(first, "law", source_type);
    const auto valve = make(second_one, "valve", scale_type);
    interface<Source>(law).par.value = 1.0;
    interface<Scale>(valve).par.gain = 1.0;
    first.add_task({"gnc", 500 * ms, 0, 0, {law}});
    second_one.add_task({"gnc", 500 * ms, 0, 0, {valve}});
    for (const int latency : {0, 1}) {
        const auto own = sim.clone();
        WireOptions options;
        options.latency = latency;
        const auto of = [&](std::size_t i) { return own->processes()[i]->instances()[0]; };
        own->connect(port(of(0), "number"), port(of(1), "number"), options);
        BatchPlan plan;
        plan.clones = 1;
        plan.every = second / 2;
        plan.actions = {{"first.law", offsetof(Source, out.number.x), FLEDGE_F64, {"x"}}};
        plan.observations = {{"second.valve", offsetof(Scale, in.number.x), FLEDGE_F64, {"x"}},
                             {"second.valve", offsetof(Scale, out.number.x), FLEDGE_F64, {"y"}}};
        Batch batch(*own, plan);
        begin(batch);
        std::vector<double> seen(2);
        ASSERT_TRUE(batch.step(std::vector{5.0}, seen));
        ASSERT_TRUE(batch.step(std::vector{6.0}, seen));
        // The valve has run at 0 and 0.5 s, and with latency at 1 s, too.
        EXPECT_THAT(seen, ::testing::ElementsAre(6.0, 6.0));
        EXPECT_EQ(interface<Scale>(batch.clone(0).processes()[1]->instances()[0]).mem.updates, latency ? 3 : 2);
    }
}

TEST(Batch, ADelayIsOfOnePeriod)
{
    Chain chain;
    const auto slow = make(chain.sim.process("flight"), "slow", scale_type);
    interface<Scale>(slow).par.gain = 1.0;
    chain.sim.process("flight").add_task({"slow", second, 0, 0, {slow}});
    chain.sim.feed(port(slow, "number"));
    BatchPlan plan = Chain::plan();
    plan.actions.push_back({"flight.slow", offsetof(Scale, in.number.x), FLEDGE_F64, {"flight.slow.number.x"}});
    EXPECT_EQ(error_of([&] { Batch(chain.sim, plan); }), "");
    plan.delay = 1;
    EXPECT_THAT(error_of([&] { Batch(chain.sim, plan); }),
                HasSubstr("delay: flight.slow.number has periods of 1 s, the actions before it of 0.5 s"));
    plan.actions.pop_back();
    plan.delay = std::numeric_limits<std::size_t>::max();
    EXPECT_THAT(error_of([&] { Batch(chain.sim, plan); }), HasSubstr("longer than any run"));
}

TEST(Batch, RunsAreThoseOfTheCampaignOfThatSeed)
{
    Nominal nominal;
    BatchPlan plan = nominal.plan(6, 2);
    plan.campaign.dispersions = {levels(2.0, 10.0)};
    CampaignPlan campaign;
    campaign.seed = 7;
    campaign.dispersions = plan.campaign.dispersions;
    Batch batch(nominal.sim, plan);
    begin(batch);
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{4, 1}, std::vector<BatchRun>{{7, 44}, {7, 11}}));
    std::vector<double> observed(6);
    batch.observe(observed);
    for (std::size_t i = 0; i < 6; i++) {
        Nominal other;
        const std::size_t run = i == 4 ? 44 : i == 1 ? 11 : i;
        const double drawn = disperse(other.sim, other.sim, campaign, run)[0];
        EXPECT_EQ(batch.draws(i)[0], drawn);
        EXPECT_EQ(observed[i], drawn);
        EXPECT_EQ(batch.run(i).index, run);
    }
}

TEST(Batch, ACloneThatFailsStandsStillUntilItIsReset)
{
    Nominal nominal;
    BatchPlan plan = nominal.plan(4, 2);
    plan.campaign.dispersions = {levels(-1.0, 1.0)}; // a level below 0 is refused when the run begins
    plan.campaign.dispersions[0].distribution.kind = Distribution::Kind::choice;
    plan.campaign.dispersions[0].distribution.choices = {-1.0, 1.0};
    Batch batch(nominal.sim, plan);
    begin(batch);
    std::vector<double> observed(4), actions(4, 0.0);
    std::size_t failed = 0;
    for (std::size_t i = 0; i < 4; i++) {
        failed += !batch.failure(i).empty();
        actions[i] = batch.failure(i).empty() ? 2.0 : std::numeric_limits<double>::quiet_NaN();
    }
    ASSERT_TRUE(failed > 0 && failed < 4);
    ASSERT_TRUE(batch.step(actions, observed));
    for (std::size_t i = 0; i < 4; i++) {
        if (batch.failure(i).empty()) {
            EXPECT_NEAR(observed[i], 2.0, 1e-12);
            continue;
        }
        EXPECT_THAT(batch.failure(i), HasSubstr("world.tank.initial must be >= 0"));
        EXPECT_TRUE(std::isnan(observed[i]));
        // Another run of it flies.
        for (std::uint64_t run = 100; !batch.failure(i).empty(); run++) {
            EXPECT_TRUE(batch.reset(std::vector{i}, std::vector<BatchRun>{{7, run}}));
        }
        actions[i] = 2.0;
    }
    ASSERT_TRUE(batch.step(actions, observed));
    EXPECT_EQ(std::count_if(observed.begin(), observed.end(), [](double x) { return std::abs(x - 2.0) < 1e-12; }),
              static_cast<std::ptrdiff_t>(failed));
}

TEST(Batch, GoesOnFromASnapshot)
{
    Nominal nominal;
    nominal.sim.run_until(3 * second);
    const double level = interface<Tank>(nominal.tank).out.level.x;
    const auto snapshot = nominal.sim.snapshot();
    Batch batch(nominal.sim, nominal.plan(3, 2));
    begin(batch);
    std::vector<double> observed(3);
    batch.observe(observed);
    EXPECT_THAT(observed, Pointwise(DoubleNear(1e-12), {8.0, 8.0, 8.0}))
        << "a batch begins at 0, wherever the original stands";
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{1}, std::vector<BatchRun>{{7, 1}}, snapshot));
    EXPECT_EQ(batch.time(1), 3 * second);
    ASSERT_TRUE(batch.step(std::vector{2.0, 2.0, 2.0}, observed));
    EXPECT_NEAR(observed[0], 9.0, 1e-12);
    EXPECT_NEAR(observed[1], level + 1.0, 1e-12);
    EXPECT_THAT(error_of([&] {
                    (void)batch.reset(std::vector<std::size_t>{0}, std::vector<BatchRun>{{7, 1}},
                                      std::span(snapshot).first(100));
                }),
                HasSubstr("truncated or damaged"));
    EXPECT_EQ(batch.time(0), second / 2) << "it is left alone";
}

TEST(Batch, ASnapshotOfACloneGoesOnInAnother)
{
    Nominal nominal;
    Batch batch(nominal.sim, nominal.plan(2));
    begin(batch);
    std::vector<double> observed(2);
    ASSERT_TRUE(batch.step(std::vector{1.0, -1.0}, observed));
    const auto snapshot = batch.copy(1)->snapshot();
    EXPECT_TRUE(batch.reset(std::vector<std::size_t>{0}, std::vector<BatchRun>{{7, 0}}, snapshot));
    batch.observe(observed);
    EXPECT_THAT(observed, Pointwise(DoubleNear(1e-12), {7.5, 7.5}));
}

TEST(Batch, AStepThatIsInterruptedIsTakenUp)
{
    Nominal nominal;
    for (unsigned threads : {1u, 2u}) {
        Batch batch(nominal.sim, nominal.plan(64, threads));
        begin(batch);
        const std::vector<double> actions(64, 0.5);
        std::vector<double> observed(64);
        const bool ended = batch.step(actions, observed, [] { return false; });
        if (threads == 1) { // else the other thread may have done all before the first look
            EXPECT_FALSE(ended);
            EXPECT_EQ(batch.time(0), second / 2);
            EXPECT_EQ(batch.time(63), 0) << "it has not come to its end";
        }
        ASSERT_TRUE(ended || batch.step(actions, observed));
        batch.observe(observed);
        for (std::size_t i = 0; i < 64; i++) {
            EXPECT_NEAR(observed[i], 8.25, 1e-12) << "each has taken one step";
            EXPECT_EQ(batch.time(i), second / 2);
        }
    }
}

TEST(Batch, AStepThatIsInterruptedKeepsItsActions)
{
    Nominal nominal;
    BatchPlan plan = nominal.plan(1);
    plan.every = 1'000'000 * second; // long enough for a look at the poll
    Batch batch(nominal.sim, plan);
    begin(batch);
    std::vector<double> observed(1);
    ASSERT_FALSE(batch.step(std::vector{0.5}, observed, [] { return false; }));
    const auto &tank = interface<Tank>(batch.clone(0).processes()[0]->instances()[0]);
    EXPECT_GT(batch.clone(0).time(), 0);
    EXPECT_LT(batch.clone(0).time(), plan.every);
    EXPECT_EQ(batch.time(0), 0);
    ASSERT_TRUE(batch.step(std::vector{7.0}, observed));
    EXPECT_NEAR(observed[0], 500'008.0, 1e-3);
    EXPECT_EQ(tank.in.flow.head.sequence, 1u);
    ASSERT_TRUE(batch.step(std::vector{7.0}, observed));
    EXPECT_NEAR(observed[0], 7'500'008.0, 1e-2);
}

TEST(Batch, TakesOneCallAtATime)
{
    Nominal nominal;
    Batch batch(nominal.sim, nominal.plan(4));
    begin(batch);
    std::vector<double> actions(4), observed(4);
    std::string error;
    ASSERT_TRUE(batch.step(actions, observed, [&] {
        error = error_of([&] { (void)batch.step(actions, observed); });
        return true;
    }));
    EXPECT_THAT(error, HasSubstr("one call at a time"));
    ASSERT_TRUE(batch.step(actions, observed));
    EXPECT_EQ(batch.time(3), second);
}

TEST(Batch, RefusesWhatCannotBe)
{
    Nominal nominal;
    const auto refused = [&](auto change) {
        BatchPlan plan = nominal.plan(2);
        change(plan);
        return error_of([&] { Batch(nominal.sim, plan); });
    };
    const auto action = [&](const char *instance, std::size_t offset) {
        return refused([&](BatchPlan &plan) {
            plan.actions = {{instance, static_cast<std::uint32_t>(offset), FLEDGE_F64, {"it"}}};
        });
    };
    EXPECT_THAT(refused([](BatchPlan &plan) { plan.clones = 0; }), HasSubstr("at least one clone"));
    EXPECT_THAT(refused([](BatchPlan &plan) { plan.every = 0; }), HasSubstr("must be > 0, found 0 s"));
    EXPECT_THAT(refused([](BatchPlan &plan) { plan.actions.push_back(plan.actions[0]); }),
                HasSubstr("two actions in the same place"));
    EXPECT_THAT(action("world.nothing", 0), HasSubstr("there is no instance world.nothing"));
    EXPECT_THAT(action("world.tank", offsetof(Tank, par.initial)), HasSubstr("is an initial value"));
    EXPECT_THAT(action("flight.control", offsetof(Scale, mem.updates)), HasSubstr("no input, output or parameter"));
    interface<Scale>(nominal.control).par.gain = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(refused([](BatchPlan &) {}), HasSubstr("flight.control.gain must be finite"));
    interface<Scale>(nominal.control).par.gain = 1.0;
    Event event;
    event.name = "calls";
    event.predicate = [] { return false; };
    event.action = [] {};
    nominal.sim.process("world").add_event(event);
    EXPECT_THAT(refused([](BatchPlan &) {}), HasSubstr("calls Python cannot be stepped in a batch, where clones would "
                                                       "share what its functions use: event world.calls"));
}

TEST(Batch, RefusesActionsThatAreNoNumbersBeforeAnyCloneMoves)
{
    Nominal nominal;
    Batch batch(nominal.sim, nominal.plan(2));
    std::vector<double> observed(2);
    EXPECT_THAT(error_of([&] {
                    (void)batch.step(std::vector{0.0, 0.0}, observed);
                }),
                HasSubstr("clone 0 has not begun"));
    begin(batch);
    EXPECT_THAT(error_of([&] {
                    (void)batch.step(std::vector{0.0, std::nan("")}, observed);
                }),
                HasSubstr("world.tank.flow.x of clone 1: expected a finite number, found nan"));
    EXPECT_EQ(batch.time(0), 0);
}

TEST(Batch, AChildOfAForkIsRefused)
{
    Nominal nominal;
    auto batch = std::make_unique<Batch>(nominal.sim, nominal.plan(2, 2));
    begin(*batch);
    if (const pid_t child = fork(); child == 0) {
        std::vector<double> observed(2);
        const bool refused = error_of([&] {
                                 (void)batch->step(std::vector{0.0, 0.0}, observed);
                             }).find("belongs to the process that made it") != std::string::npos;
        batch.reset(); // without waiting for threads that are not there
        _exit(refused ? 0 : 1);
    } else {
        int status = -1;
        ASSERT_EQ(waitpid(child, &status, 0), child);
        EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
}

} // namespace batch_test

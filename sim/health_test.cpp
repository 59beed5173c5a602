// SPDX-License-Identifier: Apache-2.0
// What a run reports although it went on.
#include "sim/health.h"

#include "sim/campaign.h"
#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <limits>

namespace health_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const double nan = std::numeric_limits<double>::quiet_NaN();

/// Writes x with the quality `quality` up to an update, and holds its output from there.
struct Moody {
    struct {
        Number number;
    } out;
    struct {
        double x;
        std::int64_t quality;
        std::int64_t holds_from;
    } par;
    struct {
        std::int64_t updates;
    } mem;
};

void moody_reset(Moody *m)
{
    m->out = {};
    m->mem = {};
}

void moody_update(Moody *m, Tick t)
{
    if (m->mem.updates++ >= m->par.holds_from) {
        m->out.number.head = head_held(m->out.number.head);
        return;
    }
    m->out.number = {head_next(m->out.number.head, t.t, static_cast<Quality>(m->par.quality)), m->par.x};
}

FledgeStruct moody_table()
{
    static FledgeField fields[2]{};
    fields[0].name = "number";
    fields[0].offset = offsetof(Moody, out.number);
    fields[0].size = sizeof(Number);
    fields[0].type = FLEDGE_STRUCT;
    fields[0].group = FLEDGE_OUT;
    fields[0].sub = &number_type;
    fields[0].unit = fields[0].doc = "";
    FledgeStruct type{};
    type.name = "Moody";
    type.doc = type.header = type.folder = "";
    type.kind = FLEDGE_MODULE;
    type.size = sizeof(Moody);
    type.align = alignof(Moody);
    type.hash = 77;
    type.n = 1;
    type.fields = fields;
    type.reset = reinterpret_cast<void (*)(void)>(moody_reset);
    type.update = reinterpret_cast<void (*)(void)>(moody_update);
    return type;
}
const FledgeStruct moody_type = moody_table();

std::shared_ptr<Instance> add(Process &process, const std::string &name, const FledgeStruct &type)
{
    auto instance = std::make_shared<Instance>(type);
    process.add(name, instance);
    return instance;
}

/// A moody module that a Scale reads, both at 10 Hz.
struct Pair {
    explicit Pair(WireOptions options = {})
    {
        source = add(flight, "source", moody_type);
        scale = add(flight, "scale", scale_type);
        interface<Moody>(source).par = {
            1.0, QUALITY_GOOD, 1'000'000
        };
        interface<Scale>(scale).par.gain = 2.0;
        sim.connect(port(source, "number"), port(scale, "number"), options);
        flight.add_task({"gnc", 100 * ms, 0, 0, {source, scale}});
    }
    std::vector<std::string> texts() const
    {
        std::vector<std::string> all;
        for (const Finding &finding : sim.health()) {
            all.push_back(std::string(kind_name(finding.kind)) + ": " + finding.text);
        }
        return all;
    }
    Simulation sim;
    Process &flight = sim.add_process("flight");
    std::shared_ptr<Instance> source, scale;
};

TEST(Health, NothingIsReportedOfARunWithoutFaults)
{
    Pair pair;
    pair.sim.run_until(1000 * ms);
    EXPECT_THAT(pair.texts(), IsEmpty());
}

TEST(Health, AHeldOutputIsReportedWithItsFirstTimeAndCount)
{
    Pair pair;
    interface<Moody>(pair.source).par.holds_from = 4;
    pair.sim.run_until(1000 * ms);
    EXPECT_THAT(pair.texts(),
                ElementsAre("held: flight.source.number held its last value at 7 of 11 updates, first at 0.4 s",
                            "degraded: flight.scale.product was degraded at 7 of 11 updates, first at 0.4 s"));
}

TEST(Health, AWiredOutputThatWasNeverWrittenIsReported)
{
    Pair pair;
    interface<Moody>(pair.source).par.holds_from = 0;
    pair.sim.run_until(1000 * ms);
    // No wire leads from the product, so that it says nothing of its own.
    EXPECT_THAT(pair.texts(),
                ElementsAre("unwritten: flight.source.number was never written; flight.scale.number reads it"));
}

TEST(Health, BeforeTheFirstExchangeNothingIsMissing)
{
    for (const Ns held_until : {0 * ms, 300 * ms}) { // the longest period is 300 ms
        Simulation sim;
        Process &world = sim.add_process("world"), &flight = sim.add_process("flight");
        const auto source = add(world, "source", source_type);
        const auto a = add(flight, "a", scale_type), b = add(flight, "b", scale_type);
        interface<Source>(source).par.value = 1.0;
        sim.connect(port(source, "number"), port(a, "number"), {1, 0});
        sim.connect(port(a, "product"), port(b, "number"));
        world.add_task({"dynamics", 300 * ms, held_until, 0, {source}});
        flight.add_task({"gnc", 100 * ms, 0, 0, {a, b}});
        sim.run_until(2000 * ms);
        EXPECT_EQ(sim.health().size(), held_until ? 1u : 0u);
    }
}

TEST(Health, AnInputOlderThanItsWireAllowsIsReported)
{
    Pair pair({0, 250 * ms});
    interface<Moody>(pair.source).par.holds_from = 1;
    interface<Moody>(pair.source).par.quality = QUALITY_DEGRADED;
    pair.sim.run_until(1000 * ms);
    EXPECT_THAT(pair.texts(), ::testing::Contains("stale: flight.scale.number was stale at 8 updates, first at 0.3 s"));
}

TEST(Health, AModuleThatCountsItsSaturationIsReported)
{
    Pair pair;
    interface<Scale>(pair.scale).par.limit = 1.5;
    pair.sim.run_until(1000 * ms);
    EXPECT_THAT(pair.texts(),
                ElementsAre("saturated: flight.scale was at its limits at 11 of 11 updates, first at 0 s"));
    pair.sim.reset();
    EXPECT_THAT(pair.texts(), IsEmpty());
}

TEST(Health, AModeThatResetsTheCounterIsNoSaturation)
{
    Pair pair;
    interface<Scale>(pair.scale).par.limit = 1.5;
    pair.flight.add_mode({"work", {"gnc"}});
    pair.flight.add_mode({"rest", {}});
    pair.sim.run_until(300 * ms); // four updates at the limit
    interface<Scale>(pair.scale).par.limit = 10.0;
    pair.sim.run_until(400 * ms);
    pair.flight.enter("rest");
    pair.sim.run_until(500 * ms);
    pair.flight.enter("work");
    pair.sim.run_until(900 * ms);
    ASSERT_EQ(pair.sim.health().size(), 1u);
    EXPECT_EQ(pair.sim.health()[0].count, 4u);
}

TEST(Health, AFlightOutputThatIsNotFiniteAndSaysGoodEndsTheRun)
{
    for (const double x : {nan, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
        Pair pair;
        pair.sim.run_until(200 * ms);
        interface<Moody>(pair.source).par.x = x;
        try {
            pair.sim.run_until(1000 * ms);
            FAIL();
        } catch (const RunError &error) {
            EXPECT_THAT(error.what(), HasSubstr("flight.source.number says GOOD at 0.3 s, but its x is "));
        }
        EXPECT_EQ(pair.sim.time(), 200 * ms);
    }
}

TEST(Health, AnOutputThatIsNotFiniteAndDegradedIsReported)
{
    Pair pair;
    interface<Moody>(pair.source).par.quality = QUALITY_DEGRADED;
    interface<Moody>(pair.source).par.x = nan;
    pair.sim.run_until(100 * ms);
    EXPECT_THAT(pair.texts(),
                ::testing::Contains("not finite: flight.source.number was not finite at 2 of 2 updates, first at 0 s"));
}

TEST(Health, LargeNumbersAndDenormalsAreFinite)
{
    for (const double x : {std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest(),
                           std::numeric_limits<double>::denorm_min(), -0.0}) {
        Pair pair;
        interface<Moody>(pair.source).par.x = x;
        interface<Scale>(pair.scale).par.gain = 0.5;
        pair.sim.run_until(100 * ms);
        EXPECT_THAT(pair.texts(), IsEmpty());
    }
}

TEST(Health, ASnapshotHoldsTheCounts)
{
    Pair pair;
    interface<Moody>(pair.source).par.holds_from = 4;
    pair.sim.run_until(600 * ms);
    const auto saved = pair.sim.snapshot();
    const auto before = pair.texts();
    const auto clone = pair.sim.clone();
    pair.sim.run_until(1000 * ms);
    const auto after = pair.texts();
    EXPECT_NE(before, after);
    pair.sim.restore(saved);
    EXPECT_EQ(pair.texts(), before);
    clone->run_until(1000 * ms);
    EXPECT_EQ(clone->health().front().text, after.front().substr(after.front().find(": ") + 2));
}

TEST(Health, AnOrderThatReadsAStepLateIsReported)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    const auto first = add(flight, "first", source_type), second = add(flight, "second", scale_type);
    interface<Source>(first).par.value = 1.0;
    sim.connect(port(first, "number"), port(second, "number"));
    flight.add_task({"gnc", 100 * ms, 0, 0, {second, first}});
    ASSERT_EQ(sim.health().size(), 1u);
    EXPECT_EQ(sim.health()[0].kind, Finding::Kind::late);
    EXPECT_EQ(sim.health()[0].text,
              "flight.second.number reads flight.first.number a step late: task flight.gnc runs flight.second before "
              "flight.first; let it run flight.first first");
}

/// Two Scales and a Source in tasks of their own. The late wires that it finds.
std::size_t late(Ns offset, int priority, bool loop, bool modes)
{
    Simulation sim;
    Process &flight = sim.add_process("flight");
    const auto a = add(flight, "a", scale_type), b = add(flight, "b", scale_type);
    sim.connect(port(a, "product"), port(b, "number"));
    if (loop) {
        sim.connect(port(b, "product"), port(a, "number"));
    }
    flight.add_task({"of_b", 200 * ms, 0, 0, {b}});
    flight.add_task({"of_a", 100 * ms, offset, priority, {a}});
    if (modes) {
        flight.add_mode({"one", {"of_a"}});
        flight.add_mode({"other", {"of_b"}});
    }
    const auto found = sim.health();
    return static_cast<std::size_t>(
        std::count_if(found.begin(), found.end(), [](const Finding &f) { return f.kind == Finding::Kind::late; }));
}

TEST(Health, AnOrderIsReportedOnlyIfAnotherOneWouldNotBeLate)
{
    EXPECT_EQ(late(0, 0, false, false), 1u);
    EXPECT_EQ(late(50 * ms, 0, false, false), 0u) << "the tasks never run at one instant";
    EXPECT_EQ(late(0, 1, false, false), 0u) << "the writer has priority";
    EXPECT_EQ(late(0, 0, true, false), 0u) << "every order of a loop is late somewhere";
    EXPECT_EQ(late(0, 0, false, true), 0u) << "no mode runs both";
}

TEST(Health, PeriodsThatDoNotDivideAreReportedOnce)
{
    const auto count = [](Ns first, Ns second) {
        Simulation sim;
        Process &world = sim.add_process("world"), &flight = sim.add_process("flight");
        const auto source = add(world, "source", source_type);
        const auto a = add(flight, "a", scale_type), b = add(flight, "b", scale_type);
        interface<Source>(source).par.value = 1.0;
        sim.connect(port(source, "number"), port(a, "number"));
        sim.connect(port(source, "number"), port(b, "number"), {1, 0});
        world.add_task({"dynamics", first, 0, 0, {source}});
        flight.add_task({"gnc", second, 0, 0, {a, b}});
        return sim.health().size();
    };
    EXPECT_EQ(count(100 * ms, 500 * ms), 0u);
    EXPECT_EQ(count(500 * ms, 100 * ms), 0u);
    EXPECT_EQ(count(300 * ms, 500 * ms), 1u);
}

TEST(Health, ACampaignKeepsTheFindingsOfEachRun)
{
    Pair pair;
    interface<Scale>(pair.scale).par.limit = 1.0;
    CampaignPlan plan;
    plan.runs = 20;
    plan.duration = 500 * ms;
    plan.every = 100 * ms;
    Dispersion gain{"flight.scale.gain", {0}, {}};
    gain.distribution.kind = Distribution::Kind::uniform;
    gain.distribution.a = 0.5;
    gain.distribution.b = 1.5;
    plan.dispersions.push_back(gain);
    const CampaignResult result = fly(pair.sim, plan, 2, {});
    std::size_t limited = 0;
    for (std::size_t run = 0; run < plan.runs; run++) {
        EXPECT_EQ(result.health[run].size(), result.draws[run] > 1.0 ? 1u : 0u) << result.draws[run];
        limited += result.health[run].size();
    }
    EXPECT_GT(limited, 0u);
    EXPECT_LT(limited, plan.runs);
}

} // namespace health_test

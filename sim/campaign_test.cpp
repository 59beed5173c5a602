// SPDX-License-Identifier: Apache-2.0
#include "sim/campaign.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace campaign_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::HasSubstr;

constexpr Ns second = 1'000'000'000;

/// The loop, from a dispersed level, with a dispersed gain.
struct Nominal : Loop {
    Nominal()
    {
        plan.seed = 7;
        plan.runs = 200;
        plan.duration = 5 * second;
        plan.every = second / 2;
        Dispersion level{"world.tank.initial", {0}, {}};
        level.distribution.a = 2.0;
        level.distribution.b = 10.0;
        Dispersion gain{"flight.control.gain", {0}, {}};
        gain.distribution.kind = Distribution::Kind::normal;
        gain.distribution.a = 1.0;
        gain.distribution.b = 0.1;
        gain.distribution.relative = true;
        plan.dispersions = {level, gain};
        plan.retained = {{"world.tank.level", offsetof(Number, x), 1}};
    }

    CampaignPlan plan;
};

TEST(Campaign, RunsFollowFromTheirDraws)
{
    Nominal nominal;
    const CampaignResult result = fly(nominal.sim, nominal.plan, 2);
    ASSERT_EQ(result.samples, 11u);
    for (std::size_t run = 0; run < 200; run++) {
        EXPECT_EQ(result.flown[run], 1);
        EXPECT_EQ(result.failures[run], "");
        const double level = result.draws[2 * run], gain = result.draws[2 * run + 1];
        EXPECT_TRUE(level >= 2.0 && level < 10.0);
        for (std::size_t k = 0; k < 11; k++) {
            const double expected = level * std::pow(1.0 + 0.5 * gain, static_cast<double>(k));
            EXPECT_NEAR(result.retained[0][run * 11 + k], expected, 1e-12) << run;
        }
    }
    EXPECT_EQ(interface<Tank>(nominal.tank).par.initial, 8.0) << "the nominal simulation is left alone";
    EXPECT_EQ(nominal.sim.now(), -1);
}

TEST(Campaign, NeitherThreadsNorOrderChangeABit)
{
    Nominal nominal;
    const CampaignResult single = fly(nominal.sim, nominal.plan, 1);
    for (unsigned threads : {2u, 5u}) {
        const CampaignResult many = fly(nominal.sim, nominal.plan, threads);
        EXPECT_EQ(single.draws, many.draws);
        EXPECT_EQ(single.retained, many.retained);
    }
    // A part of the campaign is that part.
    CampaignPlan part = nominal.plan;
    part.first = 150;
    part.runs = 3;
    const CampaignResult some = fly(nominal.sim, part, 2);
    EXPECT_TRUE(std::equal(some.draws.begin(), some.draws.end(), single.draws.begin() + 300));
    // And one run, flown by hand.
    const auto draws = disperse(nominal.sim, nominal.sim, nominal.plan, 151);
    EXPECT_EQ(draws[0], single.draws[302]);
    nominal.sim.run_until(nominal.plan.duration);
    EXPECT_EQ(interface<Tank>(nominal.tank).out.level.x, single.retained[0][151 * 11 + 10]);
}

TEST(Campaign, ARunBeginsWithTheNominalParametersWhateverTheRunBeforeHasSet)
{
    Nominal nominal;
    nominal.plan.dispersions.pop_back(); // the gain is nominal
    Event event;
    event.name = "stops";
    event.condition = Condition(
        {{nominal.control, offsetof(Scale, out.number.x), FLEDGE_F64}, Operand::of(-2.0), EXEC_LESS}, "product < -2");
    const double none = 0.0;
    const auto *bytes = reinterpret_cast<const std::byte *>(&none);
    event.set = {{nominal.control, offsetof(Scale, par.gain), {bytes, bytes + sizeof none}}};
    nominal.sim.process("flight").add_event(event);
    const CampaignResult all = fly(nominal.sim, nominal.plan, 1);
    for (std::size_t run : {0u, 1u, 199u}) {
        CampaignPlan plan = nominal.plan;
        plan.first = run;
        plan.runs = 1;
        const CampaignResult alone = fly(nominal.sim, plan, 1);
        EXPECT_EQ(all.retained[0][run * 11 + 10], alone.retained[0][10]) << run;
    }
}

TEST(Campaign, OneDispersionMoreChangesNoOthersDraws)
{
    Nominal nominal;
    const auto both = disperse(nominal.sim, nominal.sim, nominal.plan, 3);
    nominal.plan.dispersions.erase(nominal.plan.dispersions.begin());
    Nominal fresh;
    EXPECT_EQ(disperse(fresh.sim, fresh.sim, nominal.plan, 3)[0], both[1]);
}

TEST(Campaign, CountsPairsOfModesAndEventsOfEachRun)
{
    Nominal nominal;
    Process &flight = nominal.sim.process("flight");
    flight.add_mode({"active", {"gnc"}});
    flight.add_mode({"idle", {}});
    Event low;
    low.name = "low";
    low.mode = "idle";
    low.condition = below(nominal.tank, 3.0); // the tank begins between 2 and 10, and empties
    flight.add_event(std::move(low));
    nominal.plan.duration = second;
    const CampaignResult result = fly(nominal.sim, nominal.plan, 2);
    std::size_t fired = 0;
    for (std::size_t run = 0; run < 200; run++) {
        const double *level = &result.retained[0][run * 3]; // at 0, 0.5 and 1 s, as flight looks
        const bool falls = level[0] < 3.0 || level[1] < 3.0, at_end = level[2] < 3.0;
        const std::uint8_t *seen = &result.seen[5 * run]; // pairs of active and idle, and the event
        EXPECT_EQ(std::vector(seen, seen + 4), (std::vector<std::uint8_t>{0, falls, 0, 0})) << run;
        EXPECT_EQ(seen[4], falls || at_end) << run;
        fired += falls;
    }
    EXPECT_TRUE(fired > 20 && fired < 180);
}

TEST(Campaign, AFailedRunDoesNotChangeTheOtherRuns)
{
    Nominal nominal;
    nominal.plan.dispersions[0].distribution.a = -1.0; // a level below 0 is refused by the model
    nominal.plan.dispersions[0].distribution.b = 1.0;
    const CampaignResult result = fly(nominal.sim, nominal.plan, 2);
    std::size_t failed = 0;
    for (std::size_t run = 0; run < 200; run++) {
        const bool bad = result.draws[2 * run] < 0.0;
        EXPECT_EQ(!result.failures[run].empty(), bad);
        EXPECT_EQ(result.flown[run], 1);
        if (bad) {
            failed++;
            EXPECT_THAT(result.failures[run], HasSubstr("world.tank.initial must be >= 0"));
        }
        EXPECT_EQ(std::isnan(result.retained[0][run * 11]), bad);
    }
    EXPECT_GT(failed, 50u);
    EXPECT_LT(failed, 150u);
}

TEST(Campaign, DrawsWhatThePlanNames)
{
    Nominal nominal;
    auto &distribution = nominal.plan.dispersions[0].distribution;
    distribution.kind = Distribution::Kind::normal;
    distribution.a = 5.0;
    distribution.b = 2.0;
    distribution.lo = 4.0;
    distribution.hi = 8.0;
    const int n = 4000;
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        const double x = disperse(nominal.sim, nominal.sim, nominal.plan, static_cast<std::size_t>(i))[0];
        EXPECT_TRUE(x >= 4.0 && x <= 8.0);
        sum += x;
    }
    // The mean of the cut distribution, m + s (phi(l) - phi(h)) / (Phi(h) - Phi(l)), l = -1/2, h = 3/2.
    const auto phi = [](double z) { return std::exp(-0.5 * z * z) / std::sqrt(2.0 * M_PI); };
    const auto Phi = [](double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); };
    const double mean = 5.0 + 2.0 * (phi(-0.5) - phi(1.5)) / (Phi(1.5) - Phi(-0.5));
    EXPECT_NEAR(sum / n, mean, 4.0 * 1.1 / std::sqrt(n));
}

TEST(Campaign, RefusesImpossiblePlans)
{
    Nominal nominal;
    const auto error = [&](const std::function<void(CampaignPlan &)> &spoil) {
        CampaignPlan plan = nominal.plan;
        spoil(plan);
        return error_of([&] { check_plan(nominal.sim, plan); });
    };
    EXPECT_THAT(error([](auto &p) { p.dispersions[0].path = "world.tnak.initial"; }),
                HasSubstr("there is no instance world.tnak; there are world.tank and flight.control"));
    EXPECT_THAT(error([](auto &p) { p.dispersions[0].path = "world.tank.level"; }),
                HasSubstr("world.tank.level is no parameter that can be dispersed; world.tank has initial"));
    EXPECT_THAT(error([](auto &p) { p.dispersions[0].elements = {1}; }), HasSubstr("has 1 elements"));
    EXPECT_THAT(error([](auto &p) { p.dispersions[0].distribution.a = 11.0; }),
                HasSubstr("the lower bound is above the upper one"));
    EXPECT_THAT(error([](auto &p) { p.dispersions[1].distribution.b = -1.0; }),
                HasSubstr("a standard deviation must be >= 0, found -1"));
    EXPECT_THAT(error([](auto &p) { p.dispersions[1].distribution.lo = 50.0; }), HasSubstr("never falls between"));
    EXPECT_THAT(error([](auto &p) { p.dispersions[0].distribution.kind = Distribution::Kind::attitude; }),
                HasSubstr("three elements of an MRP"));
    EXPECT_THAT(error([](auto &p) { p.retained[0].port = "world.tank.initial"; }), HasSubstr("is no input or output"));
    EXPECT_THAT(error([](auto &p) { p.every = 0; }), HasSubstr("must be > 0"));
}

TEST(Campaign, ADistributionCanKeepTheParametersRule)
{
    Nominal nominal;
    const auto source = std::make_shared<Instance>(source_type); // value: required, > 0
    interface<Source>(source).par.value = 2.0;
    nominal.sim.process("flight").add("source", source);
    const auto error = [&](Distribution::Kind kind, double a, double b, double lo, double hi, bool relative = false) {
        Dispersion value{"flight.source.value", {0}, {}};
        Distribution &d = value.distribution;
        d.kind = kind;
        d.a = a;
        d.b = b;
        d.lo = lo;
        d.hi = hi;
        d.relative = relative;
        return error_of([&] { check_dispersion(nominal.sim, value); });
    };
    const double none = std::numeric_limits<double>::infinity();
    using enum Distribution::Kind;
    EXPECT_EQ(error(uniform, 0.5, 3.0, -none, none), "");
    EXPECT_THAT(error(uniform, -1.0, 3.0, -none, none),
                HasSubstr("flight.source.value must be > 0, found -1, of draws between -1 and 3"));
    EXPECT_THAT(error(uniform, -0.5, 1.5, -none, none, true), HasSubstr("of draws between -1 and 3"));
    // A normal one may reach outside, where its draws are failures, unless it is cut there or never inside.
    EXPECT_EQ(error(normal, 1.0, 1.0, -none, none), "");
    EXPECT_EQ(error(normal, -1.0, 1.0, -none, none), "");
    EXPECT_THAT(error(normal, 1.0, 1.0, -2.0, none), HasSubstr("found -2"));
    EXPECT_THAT(error(normal, -9.0, 1.0, -none, none), HasSubstr("must be > 0"));
    interface<Source>(source).par.value = 0.0;
    EXPECT_THAT(error(uniform, 0.5, 1.5, -none, none, true),
                HasSubstr("its nominal value is 0, which no factor changes"));
}

TEST(Campaign, NoElementIsDispersedTwice)
{
    Nominal nominal;
    nominal.plan.dispersions.push_back(nominal.plan.dispersions[0]);
    EXPECT_THAT(error_of([&] { check_plan(nominal.sim, nominal.plan); }),
                HasSubstr("world.tank.initial is dispersed twice"));
}

TEST(Campaign, ACompositionSetsParametersOfSeveralDraws)
{
    Nominal nominal;
    nominal.plan.dispersions.pop_back();
    Composition product;
    product.parameters = {"flight.control.gain"};
    product.numbers = {{"x", -1.0, {}}, {"y", 0.5, {}}};
    product.numbers[0].distribution.about = true;
    product.numbers[1].distribution.kind = Distribution::Kind::normal;
    product.numbers[1].distribution.b = 0.1;
    product.values = [](const std::vector<double> &x) {
        if (x[0] > 0.5) {
            throw SetupError("too far");
        }
        return std::vector{x[0] * x[1]};
    };
    const auto error = [&] { return error_of([&] { check_plan(nominal.sim, nominal.plan); }); };
    nominal.plan.compositions = {product};
    product.numbers[0].distribution.b = 2.0;
    EXPECT_EQ(error(), "");
    Nominal other;
    const auto draws = disperse(nominal.sim, other.sim, nominal.plan, 3);
    ASSERT_EQ(draws.size(), 3u);
    EXPECT_EQ(draws[1], -1.0); // uniform between 0 and 0, about the nominal -1
    EXPECT_EQ(interface<Scale>(other.control).par.gain, draws[1] * draws[2]);
    EXPECT_NE(draws[2], disperse(nominal.sim, other.sim, nominal.plan, 4)[2]);

    nominal.plan.compositions = {product};
    EXPECT_EQ(error(), "x = 1: too far");
    nominal.plan.compositions[0].parameters = {"flight.control.product"};
    EXPECT_EQ(error(), "flight.control.product is no parameter that can be dispersed");
    nominal.plan.compositions[0] = product;
    nominal.plan.compositions[0].numbers[0].distribution.b = 0.0;
    nominal.plan.dispersions.push_back({"flight.control.gain", {0}, {}});
    EXPECT_EQ(error(), "flight.control.gain is dispersed twice");
}

TEST(Campaign, AGridFliesEachPointWithTheSameDraws)
{
    Nominal nominal;
    nominal.plan.points = 6;
    for (auto [stride, choices] : {std::pair{1u, std::vector{1.0, 2.0, 3.0}}, std::pair{3u, std::vector{-1.0, -2.0}}}) {
        Dispersion &axis = nominal.plan.dispersions[stride == 1 ? 0 : 1];
        axis.distribution = {};
        axis.distribution.kind = Distribution::Kind::grid;
        axis.distribution.choices = choices;
        axis.distribution.stride = stride;
    }
    check_plan(nominal.sim, nominal.plan);
    std::vector<std::uint64_t> seeds;
    for (std::size_t index = 0; index < 12; index++) {
        Nominal other;
        const auto draws = disperse(nominal.sim, other.sim, nominal.plan, index);
        EXPECT_EQ(draws[0], 1.0 + static_cast<double>(index % 3)) << index;
        EXPECT_EQ(draws[1], -1.0 - static_cast<double>(index % 6 / 3)) << index;
        seeds.push_back(other.sim.seed());
    }
    EXPECT_EQ(seeds[0], seeds[5]);
    EXPECT_NE(seeds[0], seeds[6]);
}

TEST(Campaign, SamplesStandAtTheirTimes)
{
    // Retained four times as often as there are instants: a message holds until the next.
    Nominal nominal;
    nominal.plan.runs = 1;
    nominal.plan.every = second / 40;
    const CampaignResult often = fly(nominal.sim, nominal.plan, 1);
    nominal.plan.every = second / 10;
    const CampaignResult each = fly(nominal.sim, nominal.plan, 1);
    ASSERT_EQ(often.samples, 201u);
    ASSERT_EQ(each.samples, 51u);
    for (std::size_t k = 0; k < often.samples; k++) {
        EXPECT_EQ(often.retained[0][k], each.retained[0][k / 4]) << k;
    }
    // Retained at times that are no instants: the first instant at or after each.
    nominal.plan.every = second / 4;
    const CampaignResult between = fly(nominal.sim, nominal.plan, 1);
    EXPECT_EQ(between.retained[0][1], each.retained[0][3]); // 0.25 s: the instant 0.3 s
    EXPECT_EQ(between.retained[0][2], each.retained[0][5]);
}

TEST(Campaign, ARunFlownInASimulationOfItsOwnIsTheSame)
{
    Nominal nominal;
    const CampaignResult many = fly(nominal.sim, nominal.plan, 2);
    for (std::size_t index : {0u, 17u, 199u}) {
        Nominal fresh;
        const CampaignResult single = fly_one(fresh.sim, fresh.plan, index);
        EXPECT_EQ(single.flown, std::vector<std::uint8_t>{1});
        EXPECT_TRUE(
            std::equal(single.draws.begin(), single.draws.end(), many.draws.begin() + 2 * static_cast<long>(index)));
        EXPECT_TRUE(std::equal(single.retained[0].begin(), single.retained[0].end(),
                               many.retained[0].begin() + 11 * static_cast<long>(index)));
    }
}

TEST(Campaign, StopsOnRequestAndKeepsWhatIsFinished)
{
    Nominal nominal;
    nominal.plan.runs = 100'000;
    const CampaignResult result =
        fly(nominal.sim, nominal.plan, 2, [](CampaignProgress progress) { return progress.finished < 10; });
    const auto flown = std::count(result.flown.begin(), result.flown.end(), 1);
    EXPECT_GE(flown, 10);
    EXPECT_LT(flown, 100'000);
    for (std::size_t run = 0; run < result.flown.size(); run++) {
        ASSERT_EQ(std::isnan(result.draws[2 * run]), !result.flown[run]);
        ASSERT_EQ(std::isnan(result.retained[0][run * 11 + 10]), !result.flown[run]);
    }
}

} // namespace campaign_test

// SPDX-License-Identifier: Apache-2.0
// Formulas on board, through the code that executes all commands; python/fledge/requirements/onboard_test.py compares
// them with the simulation's judge.
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "flight/exec/condition.h"
#include "flight/services/requirement_monitor.h"
}

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace requirement_monitor_test {

using namespace service_testing;

constexpr double inf = std::numeric_limits<double>::max(), // as outputs say it
    nan = std::numeric_limits<double>::quiet_NaN();
constexpr uint32_t no_end = UINT32_MAX;

struct Output {
    Head head;
    double x[6];
};

struct Mission {
    RequirementMonitor watch;
    Output output;
};

const CommandService *const kinds[] = {&requirement_monitor_service};
const CommandServices services = command_services(
    kinds, 1, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->watch; },
    [](const void *m, uint16_t, uint32_t *size) -> const void * {
        *size = sizeof(Output);
        return &static_cast<const Mission *>(m)->output;
    });
uint8_t queue[2 * COMMAND_MAX];

FormulaNode node(FormulaOperation operation, uint32_t n = 0, double number = 0.0)
{
    FormulaNode made{};
    made.operation = operation;
    made.n = n;
    made.number = number;
    made.scale = 1.0;
    return made;
}

FormulaNode window(FormulaOperation operation, uint32_t from, uint32_t to, uint32_t delay = 0, uint32_t place = 0)
{
    FormulaNode made = node(operation);
    made.first = from, made.last = to, made.delay = delay, made.place = place;
    return made;
}

FormulaNode read_from(uint32_t first, uint32_t n)
{
    FormulaNode made = node(FORMULA_READ, n);
    made.output = 1, made.offset = static_cast<uint32_t>(offsetof(Output, x) + 8 * first), made.first = 1;
    return made;
}

FormulaNode compare(ExecRelation relation, double limit, double scale = 1.0)
{
    FormulaNode made = node(FORMULA_COMPARE, 0, limit);
    made.first = relation, made.scale = scale;
    return made;
}

using Nodes = std::vector<FormulaNode>;

Nodes operator+(Nodes a, const Nodes &b)
{
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

/// x[i] > 0: its margin is x[i].
Nodes positive(uint32_t i)
{
    return {read_from(i, 1), compare(EXEC_GREATER, 0.0)};
}

class Fly : public testing::Test {
protected:
    Fly()
    {
        table_.n_outputs = 2;
        command_begin(&state_);
        requirement_monitor_reset(&mission_.watch);
    }

    void require(const Nodes &nodes, uint32_t place = 0)
    {
        FlownRequirement &row = mission_.watch.par.requirements[place];
        row.first = static_cast<uint32_t>(used_), row.n = static_cast<uint32_t>(nodes.size());
        row.every = 10, row.on = 1;
        for (const FormulaNode &made : nodes) {
            mission_.watch.par.nodes[used_++] = made;
        }
    }

    /// An instant: what the last one left is judged, and x is what this one leaves.
    void at(std::vector<double> x = {}, Quality quality = QUALITY_GOOD)
    {
        command_execute(
            &state_, &table_, &mission_, t_, [](void *, const CommandReport *, const uint8_t *) {}, nullptr);
        requirement_monitor_update(&mission_.watch, {t_, 10});
        std::copy(x.begin(), x.end(), mission_.output.x);
        mission_.output.head = {t_, quality, mission_.output.head.sequence + 1};
        t_ += 10;
    }

    /// (low, high) after each sample.
    std::vector<std::pair<double, double>> samples(const std::vector<std::vector<double>> &all)
    {
        std::vector<std::pair<double, double>> found;
        for (std::size_t i = 0; i <= all.size(); i++) {
            at(i < all.size() ? all[i] : std::vector<double>{});
            if (i > 0) {
                found.emplace_back(shown().low[0], shown().high[0]);
            }
        }
        return found;
    }

    double first(const Nodes &nodes, const std::vector<double> &x)
    {
        mission_ = {}, used_ = 0, t_ = 0;
        requirement_monitor_reset(&mission_.watch);
        require(nodes + Nodes{node(FORMULA_FIRST)});
        const auto [low, high] = samples({x})[0];
        EXPECT_EQ(low, high);
        return low;
    }

    const RequirementState &shown() const { return mission_.watch.out.state; }
    const FlightEvent &event() const { return mission_.watch.out.event; }

    CommandTable table_ = command_table(&services, queue, sizeof queue);
    CommandState state_{};
    Mission mission_{};
    std::size_t used_ = 0;
    int64_t t_ = 0;
};

using Pairs = std::vector<std::pair<double, double>>;

TEST_F(Fly, AlwaysIsTheLeastMarginSoFarAndSaysOnceThatItIsViolated)
{
    require(positive(0) + Nodes{window(FORMULA_ALWAYS_SO_FAR, 0, no_end)});
    EXPECT_EQ(samples({{3}, {1}, {2}}), (Pairs{{-inf, 3}, {-inf, 1}, {-inf, 1}}));
    EXPECT_EQ(event().count, 0u);
    EXPECT_EQ(shown().on, 1u);
    at({-2}), at({-3}), at();
    EXPECT_EQ(shown().high[0], -3.0);
    EXPECT_EQ(shown().violated, 1u);
    EXPECT_EQ(event().count, 1u);
    EXPECT_EQ(event().id, REQUIREMENT_MONITOR_VIOLATED);
    EXPECT_EQ(event().arguments[1], -2.0);
    EXPECT_EQ(event().arguments[2], 40e-9) << "the instant of the sample, not of its judgement";
    EXPECT_EQ(shown().sampled[0], t_ - 20);
}

TEST_F(Fly, AWindowFromTheFirstSampleEndsAndHolds)
{
    require(positive(0) + Nodes{window(FORMULA_ALWAYS_SO_FAR, 1, 2)});
    EXPECT_EQ(samples({{-1}, {5}, {4}, {-1}}), (Pairs{{-inf, inf}, {-inf, 5}, {-inf, 4}, {4, 4}}));
    EXPECT_EQ(event().id, REQUIREMENT_MONITOR_HOLDS);
    EXPECT_EQ(shown().holding, 1u);
}

TEST_F(Fly, WindowsOfEachSampleAreJudgedWhenTheyAreWhole)
{
    // always(always(x, two samples)): known at the third, of the first and second
    require(positive(0) + Nodes{window(FORMULA_ALWAYS, 0, 2), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 2, 8)});
    EXPECT_EQ(samples({{4}, {5}, {3}, {6}, {1}, {9}}),
              (Pairs{{-inf, inf}, {-inf, inf}, {-inf, 4}, {-inf, 3}, {-inf, 3}, {-inf, 1}}));
}

TEST_F(Fly, UntilAndItsWindow)
{
    require(positive(0) + positive(1) + Nodes{window(FORMULA_UNTIL_SO_FAR, 0, 2)});
    EXPECT_EQ(samples({{5, -1}, {4, 3}, {-2, -3}, {1, 9}}), (Pairs{{-1, 5}, {3, 4}, {3, 3}, {3, 3}}));
    requirement_monitor_reset(&mission_.watch), used_ = 0, t_ = 0;
    require(positive(0) + positive(1) +
            Nodes{window(FORMULA_UNTIL, 0, 2), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 2, 8)});
    // of the first: max(-1, min(5, 3)) = 3; of the second: max(3, min(4, -3)); of the third: max(-3, min(-2, 9))
    EXPECT_EQ(samples({{5, -1}, {4, 3}, {-2, -3}, {1, 9}, {1, 1}}),
              (Pairs{{-inf, inf}, {-inf, inf}, {-inf, 3}, {-inf, 3}, {-inf, -2}}));
}

TEST_F(Fly, OnceBeginsAndDelay)
{
    require(positive(0) + Nodes{window(FORMULA_ONCE, 0, 0), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 0, 2)});
    EXPECT_EQ(samples({{-3}, {2}, {-1}}).back().second, -3.0);
    requirement_monitor_reset(&mission_.watch), used_ = 0, t_ = 0;
    require(positive(0) +
            Nodes{window(FORMULA_BEGINS, 0, 0), node(FORMULA_NOT), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 0, 2)});
    EXPECT_EQ(samples({{-3}, {2}, {1}}), (Pairs{{-inf, 3}, {-inf, -2}, {-inf, -2}}));
    requirement_monitor_reset(&mission_.watch), used_ = 0, t_ = 0;
    require(positive(0) + Nodes{window(FORMULA_DELAY, 0, 2), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 2, 4)});
    EXPECT_EQ(samples({{3}, {2}, {1}, {0.5}}), (Pairs{{-inf, inf}, {-inf, inf}, {-inf, 3}, {-inf, 2}}));
}

/// A node that takes samples so late takes none before, whatever it remembers.
TEST_F(Fly, WhatIsLateBeginsLate)
{
    const Nodes late = positive(0) + Nodes{window(FORMULA_DELAY, 0, 1, 0, 100)};
    require(late + Nodes{window(FORMULA_ONCE, 0, 0, 1, 0), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 1, 2)}, 0);
    require(late + Nodes{window(FORMULA_BEGINS, 0, 0, 1, 4), window(FORMULA_ALWAYS_SO_FAR, 0, no_end, 1, 6)}, 1);
    require(late + late + Nodes{window(FORMULA_UNTIL_SO_FAR, 0, no_end, 1, 8)}, 2);
    require(late + Nodes{window(FORMULA_FIRST, 0, 0, 1, 12)}, 3);
    require(late + late + Nodes{window(FORMULA_UNTIL, 0, 1, 1, 14), window(FORMULA_ALWAYS_SO_FAR, 0, 9, 2, 18)}, 4);
    for (uint32_t i = 0; i < 4; i++) { // memory of their own for the delays
        mission_.watch.par.nodes[mission_.watch.par.requirements[i].first + 2].place = 100 + 10 * i;
    }
    mission_.watch.par.nodes[mission_.watch.par.requirements[2].first + 5].place = 140;
    mission_.watch.par.nodes[mission_.watch.par.requirements[4].first + 2].place = 150;
    mission_.watch.par.nodes[mission_.watch.par.requirements[4].first + 5].place = 160;
    samples({{-3}});
    for (int i : {0, 1, 2, 3, 4}) {
        EXPECT_EQ(shown().high[i], inf) << i;
    }
    at({2}), at({1});
    EXPECT_EQ(shown().high[0], -3.0);
    EXPECT_EQ(shown().high[1], -3.0);
    EXPECT_EQ(shown().low[2], -3.0);
    EXPECT_EQ(shown().low[3], -3.0);
    EXPECT_EQ(shown().bad, 0u);
}

TEST_F(Fly, JoinsAndTheClock)
{
    EXPECT_EQ(first(positive(0) + positive(1) + Nodes{node(FORMULA_AND)}, {2, 3}), 2.0);
    EXPECT_EQ(first(positive(0) + positive(1) + Nodes{node(FORMULA_OR)}, {2, 3}), 3.0);
    EXPECT_EQ(first(positive(0) + positive(1) + Nodes{node(FORMULA_OR)}, {4, 3}), 4.0);
    EXPECT_EQ(first(positive(0) + Nodes{node(FORMULA_NOT)}, {2}), -2.0);
    EXPECT_EQ(first({node(FORMULA_CLOCK)}, {2}), inf);
    FormulaNode later = node(FORMULA_CLOCK);
    later.time = 1;
    EXPECT_EQ(first({later}, {2}), -inf);
}

TEST_F(Fly, RelationsNeverHaveTheMarginZero)
{
    const double tiny = std::numeric_limits<double>::denorm_min();
    const auto margin = [&](ExecRelation relation, double x, double scale = 1.0) {
        return first({read_from(0, 1), compare(relation, 2.0, scale)}, {x});
    };
    EXPECT_EQ(margin(EXEC_LESS, 1), 1.0);
    EXPECT_EQ(margin(EXEC_LESS, 2), -tiny);
    EXPECT_EQ(margin(EXEC_LESS_EQUAL, 2), tiny);
    EXPECT_EQ(margin(EXEC_LESS_EQUAL, 3), -1.0);
    EXPECT_EQ(margin(EXEC_GREATER, 2), -tiny);
    EXPECT_EQ(margin(EXEC_GREATER, 3, 4.0), 0.25);
    EXPECT_EQ(margin(EXEC_GREATER_EQUAL, 2, 4.0), tiny) << "a scale does not make it 0";
    EXPECT_EQ(margin(EXEC_GREATER_EQUAL, 1), -1.0);
    EXPECT_EQ(margin(EXEC_EQUAL, 2), inf);
    EXPECT_EQ(margin(EXEC_EQUAL, 1), -inf);
    EXPECT_EQ(margin(EXEC_NOT_EQUAL, 2), -inf);
    EXPECT_EQ(margin(EXEC_NOT_EQUAL, 1), inf);
}

TEST_F(Fly, Numbers)
{
    const auto value = [&](const Nodes &nodes, const std::vector<double> &x) {
        return first(nodes + Nodes{compare(EXEC_GREATER, 0.0)}, x);
    };
    const Nodes three = {read_from(0, 3)}, six = {read_from(0, 3), read_from(3, 3)};
    FormulaNode second = node(FORMULA_ELEMENT, 3);
    second.first = 1;
    EXPECT_EQ(value(three + Nodes{second}, {1, 2, 3}), 2.0);
    EXPECT_EQ(value(three + Nodes{node(FORMULA_NORM, 3)}, {2, -3, 6}), 7.0);
    EXPECT_EQ(value(three + Nodes{node(FORMULA_MAX_ABS, 3)}, {2, -7, 6}), 7.0);
    EXPECT_EQ(value(three + Nodes{node(FORMULA_MAGNITUDE, 3), second}, {2, -7, 6}), 7.0);
    EXPECT_EQ(value(six + Nodes{node(FORMULA_SUM, 3), second}, {1, 2, 3, 4, 5, 6}), 7.0);
    EXPECT_EQ(value(six + Nodes{node(FORMULA_DIFFERENCE, 3), second}, {1, 2, 3, 4, 7, 6}), -5.0);
    EXPECT_EQ(value(three + Nodes{node(FORMULA_SCALED, 3, 4.0), second}, {1, 2, 3}), 8.0);
    EXPECT_EQ(value({node(FORMULA_CONSTANT, 0, 5.0)}, {}), 5.0);
    table_.mode = [](const void *) -> uint16_t { return 3; };
    EXPECT_EQ(value({node(FORMULA_MODE)}, {}), 3.0);
    EXPECT_NEAR(value(six + Nodes{node(FORMULA_ANGLE)}, {1, 0, 0, 1, 1, 0}), std::atan(1.0), 1e-15);
    // by a quarter turn about z, sigma = tan(pi/8): x becomes -y
    EXPECT_NEAR(value(six + Nodes{node(FORMULA_TURNED), second}, {0, 0, std::tan(std::atan(1.0) / 2), 1, 0, 0}), -1.0,
                1e-15);
}

TEST_F(Fly, WhatIsNoNumberOrIsStaleIsUnknown)
{
    require({read_from(0, 3), node(FORMULA_MAX_ABS, 3), compare(EXEC_LESS, 1.0), node(FORMULA_FIRST)});
    EXPECT_EQ(samples({{nan, 0, 0}}), (Pairs{{-inf, inf}}));
    requirement_monitor_reset(&mission_.watch), t_ = 0;
    at({0, 0, 0}, QUALITY_STALE), at();
    EXPECT_EQ(shown().low[0], -inf);
    requirement_monitor_reset(&mission_.watch), t_ = 0;
    mission_.watch.par.nodes[0].first = 0; // of the head: whatever its quality
    at({0, 0, 0}, QUALITY_STALE), at();
    EXPECT_EQ(shown().low[0], 1.0);
}

TEST_F(Fly, SamplesAreMultiplesOfItsTimeAndAGapBeginsAnew)
{
    require(positive(0) + Nodes{window(FORMULA_ALWAYS_SO_FAR, 0, no_end)});
    mission_.watch.par.requirements[0].every = 20;
    EXPECT_EQ(samples({{3}, {-1}, {2}}).back(), (std::pair{-inf, 2.0})) << "not that at 10";
    t_ += 20;
    at({4}), at({4}), at({4}), at({4});
    EXPECT_EQ(event().id, REQUIREMENT_MONITOR_ANEW);
    EXPECT_EQ(shown().high[0], 4.0);
    mission_.watch.mem.samples[0] = UINT32_MAX; // there is no number for one more
    at({5}), at({5}), at({5});
    EXPECT_EQ(event().count, 2u);
    EXPECT_EQ(shown().high[0], 5.0);
}

TEST_F(Fly, OffItForgetsAndTimeThatBeginsAnewDoesToo)
{
    require(positive(0) + Nodes{window(FORMULA_ALWAYS_SO_FAR, 0, no_end)});
    EXPECT_EQ(requirement_monitor_service.next(&mission_.watch), 0);
    samples({{3}, {-1}});
    mission_.watch.par.requirements[0].on = 0;
    at({3}), at({3});
    EXPECT_EQ(shown().high[0], inf);
    EXPECT_EQ(shown().sampled[0], -1);
    EXPECT_EQ(requirement_monitor_service.next(&mission_.watch), INT64_MAX);
    mission_.watch.par.requirements[0].on = 1;
    at({3}), at({3});
    EXPECT_EQ(shown().high[0], 3.0);
    t_ = 0;
    at({2}), at();
    EXPECT_EQ(shown().high[0], 2.0);
    EXPECT_EQ(shown().sampled[0], 0);
    t_ -= 10; // the same instant once more is no sample
    at();
    EXPECT_EQ(mission_.watch.mem.samples[0], 1u);
}

TEST_F(Fly, ATableThatIsNoFormulaIsReportedOnceAndJudgesNothing)
{
    const Nodes good = positive(0) + Nodes{node(FORMULA_FIRST)};
    const auto bad = [&](const Nodes &nodes, int64_t every = 10) {
        mission_ = {}, used_ = 0, t_ = 0;
        requirement_monitor_reset(&mission_.watch);
        require(nodes);
        mission_.watch.par.requirements[0].every = every;
        at({1}), at({1}), at({1});
        const bool reported = event().count == 1 && event().id == REQUIREMENT_MONITOR_BAD;
        EXPECT_EQ(shown().head.quality, shown().bad ? QUALITY_DEGRADED : QUALITY_GOOD);
        return shown().bad == 1u && reported && shown().low[0] == -inf && shown().high[0] == inf;
    };
    EXPECT_FALSE(bad(good));
    EXPECT_TRUE(bad(good, 0));
    EXPECT_TRUE(bad({}));
    EXPECT_TRUE(bad({node(FORMULA_NOTHING)}));
    EXPECT_TRUE(bad({node(static_cast<FormulaOperation>(FORMULA_MODE + 1))}));
    EXPECT_TRUE(bad({node(FORMULA_MODE), compare(EXEC_LESS, 1.0)})) << "flight has no modes";
    EXPECT_TRUE(bad({node(FORMULA_NOT)})) << "without an operand";
    EXPECT_TRUE(bad({compare(EXEC_LESS, 0.0)}));
    EXPECT_TRUE(bad({node(FORMULA_CONSTANT)})) << "no margin";
    EXPECT_TRUE(bad(good + Nodes{node(FORMULA_CONSTANT)}));
    EXPECT_TRUE(bad(good + good));
    EXPECT_TRUE(bad(Nodes(65, node(FORMULA_CONSTANT)))) << "too many numbers";
    EXPECT_TRUE(bad(Nodes(17, node(FORMULA_CLOCK)))) << "too many margins";
    EXPECT_TRUE(bad({node(FORMULA_READ, 17)}));
    EXPECT_TRUE(bad({read_from(5, 2), node(FORMULA_NORM, 2), compare(EXEC_LESS, 1.0)})) << "beyond its output";
    FormulaNode none = read_from(0, 1), element = node(FORMULA_ELEMENT, 1);
    none.output = 2, element.first = 1;
    EXPECT_TRUE(bad({none, compare(EXEC_LESS, 1.0)})) << "no such output";
    EXPECT_TRUE(bad({read_from(0, 1), element, compare(EXEC_LESS, 1.0)}));
    for (const auto &[to, place] : std::vector<std::pair<uint32_t, uint32_t>>{
             {0, 0}, {FORMULA_MEMORY + 1, 0}, {1, FORMULA_MEMORY + 1}, {1, FORMULA_MEMORY - 3}, {1024, 1}}) {
        EXPECT_TRUE(bad(positive(0) + Nodes{window(FORMULA_ALWAYS, 0, to, 0, place)})) << to << " " << place;
    }
    EXPECT_FALSE(bad(positive(0) + Nodes{window(FORMULA_ALWAYS, 0, 1024)}));
    EXPECT_FALSE(bad(positive(0) + Nodes{window(FORMULA_ALWAYS, 0, 1, 0, FORMULA_MEMORY - 4)}));
    mission_.watch.par.requirements[0].first = FORMULA_NODES + 1;
    at();
    EXPECT_EQ(shown().bad, 1u);
    mission_.watch.par.requirements[0].first = FORMULA_NODES;
    at();
    EXPECT_EQ(shown().bad, 1u);
    EXPECT_EQ(event().count, 2u) << "that it held, and that it is bad now";
    mission_.watch.par.requirements[0].on = 0;
    at();
    EXPECT_EQ(shown().bad, 0u);
}

/// Whatever the memory of its table becomes: the sanitizers find what it touches besides its own.
TEST_F(Fly, AnyTableIsEvaluatedWithinItsMemory)
{
    std::mt19937 random(3);
    int judged = 0;
    const auto below = [&](uint32_t n) { return static_cast<uint32_t>(random() % n); };
    for (int i = 0; i < 3'000; i++) {
        used_ = 0, t_ = 0;
        requirement_monitor_reset(&mission_.watch);
        Nodes nodes = positive(0) + positive(1);
        for (uint32_t k = below(6); k > 0; k--) {
            FormulaNode made =
                window(static_cast<FormulaOperation>(below(27)), below(4), below(8), below(4), below(4104));
            made.n = below(8), made.output = below(3), made.offset = below(70), made.type = below(13);
            nodes.push_back(made);
        }
        require(nodes + Nodes{node(FORMULA_OR), window(FORMULA_ALWAYS_SO_FAR, 0, no_end)});
        for (int k = 0; k < 12; k++) {
            at({1, 2, 3, 4, 5, 6});
        }
        judged += mission_.watch.mem.samples[0] > 0u;
    }
    EXPECT_GT(judged, 300);
}

} // namespace requirement_monitor_test

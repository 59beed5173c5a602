// SPDX-License-Identifier: Apache-2.0
#include "sim/temporal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace fledge::sim {
namespace temporal_test {

using Kind = FormulaNode::Kind;

struct Signals {
    std::vector<Ns> times;
    std::vector<std::vector<Robustness>> atoms; ///< by sample
    Ns end = 0;
};

struct Interval {
    double low, high;
};

/// The definition, written down: each window is looked through at each sample.
class Naive {
public:
    Naive(const std::vector<FormulaNode> &nodes, const Signals &signals) : nodes_(nodes), signals_(signals) {}

    Interval at(int node, std::size_t i) const
    {
        const FormulaNode &what = nodes_[static_cast<std::size_t>(node)];
        const Ns t = signals_.times[i];
        const auto beyond = [&] { return what.to != no_end && t + what.to > signals_.end; };
        switch (what.kind) {
        case Kind::ATOM: {
            const Robustness &value = signals_.atoms[i][static_cast<std::size_t>(what.a)];
            return {value.low, value.high};
        }
        case Kind::CONSTANT: return certain(what.a != 0);
        case Kind::CLOCK: return certain(t >= what.from);
        case Kind::NOT: return inverse(at(what.a, i));
        case Kind::AND: return both(at(what.a, i), at(what.b, i));
        case Kind::OR: return inverse(both(inverse(at(what.a, i)), inverse(at(what.b, i))));
        case Kind::ALWAYS: return always(what, i, beyond(), false);
        case Kind::EVENTUALLY: return inverse(always(what, i, beyond(), true));
        case Kind::UNTIL: {
            Interval found = certain(false), before = certain(true);
            for (std::size_t k = i; k < signals_.times.size(); k++) {
                if (what.to != no_end && signals_.times[k] > t + what.to) {
                    break;
                }
                found = inverse(both(inverse(found), inverse(both(at(what.b, k), before))));
                before = both(before, at(what.a, k));
            }
            return {found.low, beyond() ? std::max(found.high, before.high) : found.high};
        }
        case Kind::ONCE: {
            Interval found = certain(false);
            for (std::size_t k = 0; k <= i; k++) {
                found = inverse(both(inverse(found), inverse(at(what.a, k))));
            }
            return found;
        }
        case Kind::BEGINS: return i ? both(at(what.a, i), inverse(at(what.a, i - 1))) : at(what.a, i);
        }
        return {};
    }

private:
    static Interval certain(bool holds)
    {
        return holds ? Interval{unbounded, unbounded} : Interval{-unbounded, -unbounded};
    }
    static Interval inverse(Interval x) { return {-x.high, -x.low}; }
    static Interval both(Interval x, Interval y) { return {std::min(x.low, y.low), std::min(x.high, y.high)}; }

    Interval always(const FormulaNode &what, std::size_t i, bool beyond, bool inverted) const
    {
        Interval found = certain(true);
        for (std::size_t k = i; k < signals_.times.size(); k++) {
            const Ns later = signals_.times[k] - signals_.times[i];
            if (later >= what.from && later <= what.to) {
                found = both(found, inverted ? inverse(at(what.a, k)) : at(what.a, k));
            }
        }
        return {beyond ? -unbounded : found.low, found.high};
    }

    const std::vector<FormulaNode> &nodes_;
    const Signals &signals_;
};

class Random {
public:
    explicit Random(unsigned seed) : engine_(seed) {}

    int below(int n) { return std::uniform_int_distribution(0, n - 1)(engine_); }

    /// A tree in postfix order.
    std::vector<FormulaNode> formula(int atoms)
    {
        std::vector<FormulaNode> nodes;
        add(nodes, atoms, 1 + below(4));
        return nodes;
    }

    Signals signals(int atoms)
    {
        Signals found;
        Ns t = below(3);
        for (int n = below(14); n >= 0; n--, t += 1 + below(3)) {
            found.times.push_back(t);
            std::vector<Robustness> row;
            for (int a = 0; a < atoms; a++) {
                const double low = below(9) - 4.5;
                const int kind = below(8);
                row.push_back(kind == 0   ? Robustness{}
                              : kind == 1 ? Robustness{low, low + below(4), {t, a}, {t, a}}
                              : kind == 2 ? Robustness::known(below(2) ? unbounded : -unbounded, {t, a})
                                          : Robustness::known(low, {t, a}));
            }
            found.atoms.push_back(row);
        }
        found.end = found.times.back() + below(3);
        return found;
    }

private:
    int add(std::vector<FormulaNode> &nodes, int atoms, int depth)
    {
        FormulaNode node;
        node.kind = depth == 0 ? Kind::ATOM : static_cast<Kind>(below(Kind::CLOCK + 1));
        switch (node.kind) {
        case Kind::ATOM: node.a = below(atoms); break;
        case Kind::CONSTANT: node.a = below(2); break;
        case Kind::CLOCK: node.from = below(20); break;
        default: {
            if (node.kind == Kind::ALWAYS || node.kind == Kind::EVENTUALLY || node.kind == Kind::UNTIL) {
                node.from = node.kind == Kind::UNTIL ? 0 : below(2) * below(9);
                node.to = below(3) ? node.from + below(12) : no_end;
            }
            node.a = add(nodes, atoms, depth - 1);
            if (node.kind == Kind::AND || node.kind == Kind::OR || node.kind == Kind::UNTIL) {
                node.b = add(nodes, atoms, depth - 1);
            }
        }
        }
        nodes.push_back(node);
        return static_cast<int>(nodes.size()) - 1;
    }

    std::mt19937 engine_;
};

Robustness judged(const std::vector<FormulaNode> &nodes, const Signals &signals)
{
    TemporalMonitor monitor(nodes);
    for (std::size_t i = 0; i < signals.times.size(); i++) {
        monitor.step(signals.times[i], signals.atoms[i]);
    }
    monitor.finish(signals.end);
    return monitor.value();
}

TEST(TemporalMonitor, EqualsTheDefinitionOnRandomFormulasAndSignals)
{
    int decided = 0, unknown = 0;
    for (unsigned seed = 0; seed < 20'000; seed++) {
        Random random(seed);
        const auto nodes = random.formula(3);
        const Signals signals = random.signals(3);
        const Interval wanted = Naive(nodes, signals).at(static_cast<int>(nodes.size()) - 1, 0);
        const Robustness found = judged(nodes, signals);
        ASSERT_EQ(found.low, wanted.low) << seed;
        ASSERT_EQ(found.high, wanted.high) << seed;
        (wanted.low > 0 || wanted.high < 0 ? decided : unknown)++;
    }
    EXPECT_GT(decided, 8'000);
    EXPECT_GT(unknown, 1'000);
}

TEST(TemporalMonitor, KnowsNeverMoreThanTheEndDoes)
{
    for (unsigned seed = 0; seed < 3'000; seed++) {
        Random random(seed);
        const auto nodes = random.formula(3);
        const Signals signals = random.signals(3);
        const Robustness end = judged(nodes, signals);
        TemporalMonitor monitor(nodes);
        double low = -unbounded, high = unbounded;
        for (std::size_t i = 0; i < signals.times.size(); i++) {
            monitor.step(signals.times[i], signals.atoms[i]);
            const Robustness now = monitor.value();
            ASSERT_LE(low, now.low) << seed;
            ASSERT_GE(high, now.high) << seed;
            low = now.low, high = now.high;
        }
        ASSERT_LE(low, end.low) << seed;
        ASSERT_GE(high, end.high) << seed;
        monitor.reset();
        for (std::size_t i = 0; i < signals.times.size(); i++) {
            monitor.step(signals.times[i], signals.atoms[i]);
        }
        monitor.finish(signals.end);
        ASSERT_EQ(monitor.value().low, end.low);
        ASSERT_EQ(monitor.value().high, end.high);
    }
}

/// The witness names the sample and the atom that have the bound.
TEST(TemporalMonitor, NamesTheSampleThatDecides)
{
    for (unsigned seed = 0; seed < 3'000; seed++) {
        Random random(seed);
        const auto nodes = random.formula(3);
        const Signals signals = random.signals(3);
        const Robustness found = judged(nodes, signals);
        for (const auto &[bound, at] : {std::pair{found.low, found.at_low}, std::pair{found.high, found.at_high}}) {
            if (std::isfinite(bound)) {
                const auto i = std::find(signals.times.begin(), signals.times.end(), at.t) - signals.times.begin();
                ASSERT_LT(static_cast<std::size_t>(i), signals.times.size()) << seed;
                const Robustness &atom = signals.atoms[static_cast<std::size_t>(i)][static_cast<std::size_t>(at.atom)];
                ASSERT_TRUE(bound == atom.low || bound == atom.high || -bound == atom.low || -bound == atom.high);
            }
        }
    }
}

/// Kleene's three-valued logic.
TEST(TemporalMonitor, HasTheTruthTablesOfThreeValues)
{
    const Robustness values[] = {Robustness::known(-1), {}, Robustness::known(1)}; // false, unknown, true
    const auto truth = [](const Robustness &x) { return x.low > 0 ? 2 : x.high < 0 ? 0 : 1; };
    for (int a = 0; a < 3; a++) {
        const Signals operand{{0}, {{values[a], values[a]}}, 0};
        EXPECT_EQ(truth(judged({{Kind::ATOM, 0}, {Kind::NOT, 0}}, operand)), 2 - a);
        for (int b = 0; b < 3; b++) {
            const Signals two{{0}, {{values[a], values[b]}}, 0};
            const std::vector<FormulaNode> atoms = {{Kind::ATOM, 0}, {Kind::ATOM, 1}};
            for (const Kind kind : {Kind::AND, Kind::OR}) {
                auto nodes = atoms;
                nodes.push_back({kind, 0, 1});
                EXPECT_EQ(truth(judged(nodes, two)), kind == Kind::AND ? std::min(a, b) : std::max(a, b));
            }
        }
    }
}

TEST(TemporalMonitor, RefusesWhatIsNoFormula)
{
    const FormulaNode atom{Kind::ATOM, 0};
    EXPECT_THROW(TemporalMonitor({}), std::invalid_argument);
    EXPECT_THROW(TemporalMonitor({atom, atom}), std::invalid_argument);
    EXPECT_THROW(TemporalMonitor({{Kind::NOT, 0}}), std::invalid_argument);
    EXPECT_THROW(TemporalMonitor({atom, {Kind::AND, 0, 0}}), std::invalid_argument);
    EXPECT_THROW(TemporalMonitor({atom, {Kind::ALWAYS, 0, -1, 5, 4}}), std::invalid_argument);
}

/// Values of published examples: tests of RTAMT in discrete time (D. Nickovic, T. Yamaguchi, 2020), and the intervals
/// that the documentation of mstlo gives for its first example.
TEST(TemporalMonitor, GivesPublishedValues)
{
    const double left[] = {100, -1, -2, 5, -1}, right[] = {20, -2, 10, 4, -1};
    const FormulaNode a{Kind::ATOM, 0}, b{Kind::ATOM, 1};
    const auto from_each_sample = [&](const std::vector<FormulaNode> &nodes) {
        std::vector<double> found;
        for (int first = 0; first < 5; first++) {
            Signals signals;
            for (int i = first; i < 5; i++) {
                signals.times.push_back(i);
                signals.atoms.push_back({Robustness::known(left[i]), Robustness::known(right[i])});
            }
            signals.end = 10; // there a window that reaches beyond the last sample is whole
            found.push_back(judged(nodes, signals).low);
        }
        return found;
    };
    using Values = std::vector<double>;
    EXPECT_EQ(from_each_sample({a, {Kind::EVENTUALLY, 0}}), (Values{100, 5, 5, 5, -1}));
    EXPECT_EQ(from_each_sample({a, {Kind::EVENTUALLY, 0, -1, 0, 1}}), (Values{100, -1, 5, 5, -1}));
    EXPECT_EQ(from_each_sample({a, b, {Kind::UNTIL, 0, 1}}), (Values{20, -1, 10, 4, -1}));
    EXPECT_EQ(from_each_sample({a, b, {Kind::UNTIL, 0, 1, 0, 1}}), (Values{20, -1, 10, 4, -1}));

    TemporalMonitor monitor({a, {Kind::ALWAYS, 0, -1, 0, 2}}); // of x > 5
    const Robustness seven[] = {Robustness::known(7.0 - 5.0)}, four[] = {Robustness::known(4.0 - 5.0)};
    monitor.step(0, seven);
    EXPECT_EQ(monitor.value().low, -unbounded);
    EXPECT_EQ(monitor.value().high, 2.0);
    monitor.step(1, four);
    EXPECT_EQ(monitor.value().low, -unbounded);
    EXPECT_EQ(monitor.value().high, -1.0);
}

} // namespace temporal_test
} // namespace fledge::sim

// SPDX-License-Identifier: Apache-2.0
#include "sim/temporal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

namespace fledge::sim {
namespace temporal_test {

using Kind = FormulaNode::Kind;

struct Signals {
    std::vector<Ns> times;
    std::vector<std::vector<double>> atoms; ///< by sample; NaN: without a value
    Ns end = 0;
};

/// The definition, written down: each window is looked through at each sample.
class Naive {
public:
    Naive(const std::vector<FormulaNode> &nodes, const Signals &signals) : nodes_(nodes), signals_(signals) {}

    Robustness at(int node, std::size_t i) const
    {
        const FormulaNode &what = nodes_[static_cast<std::size_t>(node)];
        const Ns t = signals_.times[i];
        const auto beyond = [&] { return what.to != no_end && t + what.to > signals_.end; };
        switch (what.kind) {
        case Kind::ATOM: {
            const double x = signals_.atoms[i][static_cast<std::size_t>(what.a)];
            const Witness here{t, what.a, std::isnan(x)};
            return here.unknown ? Robustness{-unbounded, unbounded, here, here} : Robustness::known(x, here);
        }
        case Kind::CONSTANT: return certain(what.a != 0);
        case Kind::CLOCK: return certain(t >= what.from);
        case Kind::NOT: return -at(what.a, i);
        case Kind::AND: return least(at(what.a, i), at(what.b, i));
        case Kind::OR: return -least(-at(what.a, i), -at(what.b, i));
        case Kind::ALWAYS: return always(what, i, beyond(), false);
        case Kind::EVENTUALLY: return -always(what, i, beyond(), true);
        case Kind::UNTIL: {
            Robustness found = certain(false), before = certain(true);
            for (std::size_t k = i; k < signals_.times.size(); k++) {
                if (what.to != no_end && signals_.times[k] > t + what.to) {
                    break;
                }
                found = -least(-found, -least(at(what.b, k), before));
                before = least(before, at(what.a, k));
            }
            if (beyond() && before.high > found.high) {
                found.high = before.high, found.at_high = before.at_high;
            }
            return found;
        }
        case Kind::ONCE: {
            Robustness found = certain(false);
            for (std::size_t k = 0; k <= i; k++) {
                found = -least(-found, -at(what.a, k));
            }
            return found;
        }
        case Kind::BEGINS: return i ? least(at(what.a, i), -at(what.a, i - 1)) : at(what.a, i);
        }
        return {};
    }

private:
    static Robustness certain(bool holds) { return holds ? true_always : false_always; }

    Robustness always(const FormulaNode &what, std::size_t i, bool beyond, bool inverted) const
    {
        Robustness found = certain(true);
        for (std::size_t k = i; k < signals_.times.size(); k++) {
            const Ns later = signals_.times[k] - signals_.times[i];
            if (later >= what.from && later <= what.to) {
                found = least(found, inverted ? -at(what.a, k) : at(what.a, k));
            }
        }
        if (beyond) {
            found.low = -unbounded, found.at_low = {};
        }
        return found;
    }

    const std::vector<FormulaNode> &nodes_;
    const Signals &signals_;
};

class Random {
public:
    explicit Random(unsigned seed) : engine_(seed) {}

    int below(int n) { return std::uniform_int_distribution(0, n - 1)(engine_); }

    /// A tree in postfix order.
    std::vector<FormulaNode> formula(int atoms, int depth = 4)
    {
        std::vector<FormulaNode> nodes;
        add(nodes, atoms, 1 + below(depth));
        return nodes;
    }

    /// distinct: no two finite numbers are equal.
    Signals signals(int atoms, int most = 14, bool distinct = false)
    {
        Signals found;
        Ns t = below(3);
        int without = 0; // how many atoms have no value from here on
        for (int n = below(most); n >= 0; n--, t += 1 + below(3)) {
            found.times.push_back(t);
            std::vector<double> row;
            for (int a = 0; a < atoms; a++) {
                without = below(most) == 0 ? below(most) : std::max(without - 1, 0);
                const double inverted = below(2) ? 1.0 : -1.0;
                const double x = below(9) - 4.5 + (distinct ? std::uniform_real_distribution(0.0, 0.1)(engine_) : 0.0);
                row.push_back(without || below(10) == 0 ? NAN : below(8) == 0 ? inverted * unbounded : x);
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

/// Gives a monitor samples in blocks.
class Feed {
public:
    Feed(TemporalMonitor &monitor, const Signals &signals) : monitor_(monitor), signals_(signals) {}

    /// The next samples, so many; false if there are none.
    bool take(std::size_t n)
    {
        n = std::min({n, Instants::most, signals_.times.size() - given_});
        std::vector<double> margins(signals_.atoms[0].size() * Instants::most, 1.0);
        std::vector<unsigned char> unknown(signals_.atoms[0].size(), 0);
        for (std::size_t k = 0; k < n; k++) {
            for (std::size_t a = 0; a < signals_.atoms[0].size(); a++) {
                margins[a * Instants::most + k] = signals_.atoms[given_ + k][a];
                unknown[a] |= std::isnan(signals_.atoms[given_ + k][a]) ? 1 : 0;
            }
        }
        monitor_.take({signals_.times.data() + given_, n}, margins.data(), unknown.data());
        given_ += n;
        return n > 0;
    }

private:
    TemporalMonitor &monitor_;
    const Signals &signals_;
    std::size_t given_ = 0;
};

Robustness judged(const std::vector<FormulaNode> &nodes, const Signals &signals)
{
    TemporalMonitor monitor;
    monitor.formula(nodes);
    Feed feed(monitor, signals);
    while (feed.take(Instants::most)) {
    }
    monitor.finish(signals.end);
    return monitor.value(0);
}

/// The bounds, and where they are the only ones, which sample and atom decided them.
void expect_same(const Robustness &found, const Robustness &wanted, bool distinct, unsigned seed)
{
    ASSERT_EQ(found.low, wanted.low) << seed;
    ASSERT_EQ(found.high, wanted.high) << seed;
    for (const auto &[bound, a, b] :
         {std::tuple{found.low, found.at_low, wanted.at_low}, std::tuple{found.high, found.at_high, wanted.at_high}}) {
        if (distinct && std::isfinite(bound)) {
            ASSERT_EQ(std::tuple(a.t, a.atom), std::tuple(b.t, b.atom)) << seed;
        }
    }
}

/// Whatever formulas share a monitor, however their samples are cut into blocks.
TEST(TemporalMonitor, EqualsTheDefinitionOnRandomFormulasAndSignals)
{
    int decided = 0, unknown = 0;
    for (unsigned seed = 0; seed < 8'000; seed++) {
        Random random(seed);
        TemporalMonitor monitor;
        std::vector<std::vector<FormulaNode>> formulas(3);
        for (auto &nodes : formulas) {
            nodes = random.formula(3);
            monitor.formula(nodes);
        }
        for (int run = 0; run < 2; run++) {
            const Signals signals = random.signals(3, 14, run == 0);
            Feed feed(monitor, signals);
            while (feed.take(static_cast<std::size_t>(1 + random.below(14)))) {
            }
            monitor.finish(signals.end);
            for (std::size_t f = 0; f < formulas.size(); f++) {
                const int last = static_cast<int>(formulas[f].size()) - 1;
                const Robustness wanted = Naive(formulas[f], signals).at(last, 0);
                expect_same(monitor.value(static_cast<int>(f)), wanted, run == 0, seed);
                (wanted.low > 0 || wanted.high < 0 ? decided : unknown)++;
            }
            monitor.reset();
        }
    }
    EXPECT_GT(decided, 20'000);
    EXPECT_GT(unknown, 3'000);
}

/// Signals of several blocks.
TEST(TemporalMonitor, EqualsTheDefinitionAcrossBlocks)
{
    for (unsigned seed = 0; seed < 400; seed++) {
        Random random(seed);
        const auto nodes = random.formula(3, 2);
        const Signals signals = random.signals(3, 4 * static_cast<int>(Instants::most), true);
        const Robustness wanted = Naive(nodes, signals).at(static_cast<int>(nodes.size()) - 1, 0);
        expect_same(judged(nodes, signals), wanted, true, seed);
    }
}

/// What must follow, within a window, wherever something holds: the window waits beside a part that does not.
TEST(TemporalMonitor, EqualsTheDefinitionOfResponses)
{
    for (unsigned seed = 0; seed < 2'000; seed++) {
        Random random(seed);
        std::vector<FormulaNode> nodes = random.formula(3, 2);
        const bool all = random.below(2) != 0, dual = random.below(4) != 0, second = random.below(2) != 0;
        const Kind always = all ? Kind::ALWAYS : Kind::EVENTUALLY, eventually = all ? Kind::EVENTUALLY : Kind::ALWAYS;
        const int beside = static_cast<int>(nodes.size()) - 1, from = random.below(2) * random.below(4);
        nodes.push_back({Kind::ATOM, random.below(3)});
        nodes.push_back({random.below(2) ? Kind::NOT : Kind::BEGINS, beside + 1});
        nodes.push_back({dual ? eventually : always, beside + 2, -1, from, random.below(3) ? from + 9 : no_end});
        nodes.push_back({all ? Kind::OR : Kind::AND, second ? beside + 3 : beside, second ? beside : beside + 3});
        nodes.push_back({always, beside + 4, -1, random.below(3)});
        Signals signals = random.signals(3, 2 * static_cast<int>(Instants::most), seed % 2 == 0);
        const std::size_t known = random.below(2) ? signals.times.size() * 2 / 3 : 0; // for so many samples
        for (std::size_t i = 0; i < known; i++) {
            for (double &x : signals.atoms[i]) {
                x = std::isnan(x) ? 0.001 * static_cast<double>(i) : x;
            }
        }
        TemporalMonitor monitor;
        monitor.formula(nodes);
        Feed feed(monitor, signals);
        while (feed.take(static_cast<std::size_t>(1 + random.below(static_cast<int>(Instants::most))))) {
        }
        monitor.finish(signals.end);
        expect_same(monitor.value(0), Naive(nodes, signals).at(beside + 5, 0), seed % 2 == 0, seed);
    }
}

TEST(TemporalMonitor, KnowsNeverMoreThanTheEndDoes)
{
    for (unsigned seed = 0; seed < 3'000; seed++) {
        Random random(seed);
        const auto nodes = random.formula(3);
        const Signals signals = random.signals(3);
        const Robustness end = judged(nodes, signals);
        TemporalMonitor monitor;
        monitor.formula(nodes);
        double low = -unbounded, high = unbounded;
        Feed feed(monitor, signals);
        while (feed.take(1)) {
            const Robustness now = monitor.value(0);
            ASSERT_LE(low, now.low) << seed;
            ASSERT_GE(high, now.high) << seed;
            low = now.low, high = now.high;
        }
        ASSERT_LE(low, end.low) << seed;
        ASSERT_GE(high, end.high) << seed;
    }
}

/// Kleene's three-valued logic.
TEST(TemporalMonitor, HasTheTruthTablesOfThreeValues)
{
    const double values[] = {-1, NAN, 1}; // false, unknown, true
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
    TemporalMonitor monitor;
    EXPECT_THROW(monitor.formula({}), std::invalid_argument);
    EXPECT_THROW(monitor.formula({atom, atom}), std::invalid_argument);
    EXPECT_THROW(monitor.formula({{Kind::NOT, 0}}), std::invalid_argument);
    EXPECT_THROW(monitor.formula({atom, {Kind::AND, 0, 0}}), std::invalid_argument);
    EXPECT_THROW(monitor.formula({atom, {Kind::ALWAYS, 0, -1, 5, 4}}), std::invalid_argument);
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
                signals.atoms.push_back({left[i], right[i]});
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

    TemporalMonitor monitor; // of x > 5
    monitor.formula({a, {Kind::ALWAYS, 0, -1, 0, 2}});
    const Signals seven_and_four{{0, 1}, {{7.0 - 5.0}, {4.0 - 5.0}}, 1};
    Feed feed(monitor, seven_and_four);
    feed.take(1);
    EXPECT_EQ(monitor.value(0).low, -unbounded);
    EXPECT_EQ(monitor.value(0).high, 2.0);
    feed.take(1);
    EXPECT_EQ(monitor.value(0).low, -unbounded);
    EXPECT_EQ(monitor.value(0).high, -1.0);
}

} // namespace temporal_test
} // namespace fledge::sim

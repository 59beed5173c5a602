// SPDX-License-Identifier: Apache-2.0
// Signal temporal logic with quantitative semantics over sampled signals: how far a formula is from changing its
// truth. Each value is an interval, because a sample may be unknown and a window may reach beyond the end: [-inf, inf]
// says nothing. A formula holds if its interval lies above zero, and is violated if it lies below.
//
// The semantics are pointwise: a formula has a value at each sample, and a window has the samples in it.
// Sources: A. Donze, O. Maler, Robust satisfaction of temporal logic over real-valued signals, 2010; J. V. Deshmukh
// et al., Robust online monitoring of signal temporal logic, 2017 (intervals of what is not known yet).
#pragma once

#include "sim/integrator.h"

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace fledge::sim {

inline constexpr double unbounded = std::numeric_limits<double>::infinity();
inline constexpr Ns no_end = std::numeric_limits<Ns>::max();

/// Which sample and which atom decided a bound; unknown: as the atom had no value there.
struct Witness {
    Ns t = -1;
    int atom = -1;
    bool unknown = false;
};

/// What is known of a robustness.
struct Robustness {
    double low = -unbounded, high = unbounded;
    Witness at_low, at_high;

    static Robustness known(double value, Witness at = {}) { return {value, value, at, at}; }
    Robustness operator-() const { return {-high, -low, at_high, at_low}; }
};

/// Of equal bounds that of the first, but rather one of an atom without a value: it is why nothing is known.
Robustness least(const Robustness &a, const Robustness &b);
Robustness greatest(const Robustness &a, const Robustness &b);

/// A formula as a tree in postfix order: the operands of a node come before it.
struct FormulaNode {
    enum Kind : std::uint8_t {
        ATOM,     ///< a: its number
        CONSTANT, ///< true if a is not 0
        NOT,
        AND,
        OR,
        ALWAYS,     ///< at all samples of [t + from, t + to]; with none in it, true
        EVENTUALLY, ///< at one of them; with none in it, false
        UNTIL,      ///< the second at a sample of [t, t + to], and the first at all samples before that one
        ONCE,       ///< at this sample or one before
        BEGINS,     ///< at this sample, and not at the one before
        CLOCK,      ///< true from the time `from` on
    } kind = ATOM;
    int a = -1, b = -1; ///< operands, by index; of an ATOM its number
    Ns from = 0, to = no_end;
};

/// Evaluates a formula as samples come, with what its windows need of them and nothing else.
class TemporalMonitor {
public:
    /// The last node is the formula. Throws std::invalid_argument if an operand does not come before its node, is
    /// the operand of two, or if a window is none.
    explicit TemporalMonitor(std::vector<FormulaNode> nodes);

    /// A sample, later than the one before, with the values of all atoms.
    void step(Ns t, std::span<const Robustness> atoms);
    /// There is no sample after t: what windows that reach further need is unknown.
    void finish(Ns t);
    void reset();

    /// The formula's value at the first sample, by what has come so far.
    Robustness value() const;

private:
    struct Sample {
        Ns t;
        Robustness value, other; ///< other: of the second operand
    };
    /// First in, first out, in one piece of memory.
    template <class T> class Queue {
    public:
        bool empty() const { return begin_ == items_.size(); }
        std::size_t size() const { return items_.size() - begin_; }
        T &front() { return items_[begin_]; }
        T &back() { return items_.back(); }
        T &operator[](std::size_t i) { return items_[begin_ + i]; }
        void push(const T &item) { items_.push_back(item); }
        void pop_back() { items_.pop_back(); }
        void clear() { items_.clear(), begin_ = 0; }
        void pop()
        {
            if (++begin_ == items_.size()) {
                clear();
            } else if (begin_ > 64 && begin_ > items_.size() / 2) {
                items_.erase(items_.begin(), items_.begin() + static_cast<std::ptrdiff_t>(begin_));
                begin_ = 0;
            }
        }

    private:
        std::vector<T> items_;
        std::size_t begin_ = 0;
    };
    struct Bound {
        Ns t;
        double value;
        Witness at;
    };
    struct Node {
        FormulaNode what;
        int parent = -1;
        bool second = false;      ///< it is its parent's second operand
        bool instant = false;     ///< its value at a sample is known at that sample
        bool front = false;       ///< only its value at the first sample counts
        bool started = false;     ///< BEGINS has had a sample
        bool passed = false;      ///< of a front node: its window lies before the newest sample
        Robustness value;         ///< of an instant node at the newest sample; of others what they have gathered
        Robustness before;        ///< of BEGINS at the sample before; of UNTIL in front the first operand so far
        Queue<Ns> pending;        ///< samples at which the value is not known yet
        Queue<Bound> lows, highs; ///< of a window, monotonic: the least bound from each sample on
        Queue<Sample> waiting;    ///< for the other operand
        std::size_t here[2] = {}; ///< how many of those have each operand
        Queue<Sample> samples;    ///< of UNTIL, and of a window without an end
    };

    void evaluate(Node &node, Ns t, std::span<const Robustness> atoms);
    void take(Node &node, bool second, Ns t, const Robustness &value);
    void join(Node &node, bool second, Ns t, const Robustness &value);
    void give(const Node &node, Ns t, const Robustness &value);
    void gather(Node &node, Ns t, const Robustness &value, const Robustness &other);
    void take_window(Node &node, Ns t, const Robustness &value);
    void give_windows(Node &node, Ns before);
    void give_until(Node &node, Ns before);
    void close(Node &node);
    Robustness front(const Node &node) const;

    std::vector<Node> nodes_;
    std::vector<int> instants_; ///< nodes to evaluate at each sample
    Ns first_ = -1;
    Ns end_ = -1; ///< -1: not finished
};

} // namespace fledge::sim

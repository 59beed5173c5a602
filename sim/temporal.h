// SPDX-License-Identifier: Apache-2.0
// Evaluates formulas (sim/formula.h) as blocks of samples come, with what their windows need of them and nothing else.
#pragma once

#include "sim/instants.h"

#include <span>
#include <vector>

namespace fledge::sim {

class TemporalMonitor {
public:
    /// A formula's number, from 0: the last node is the formula. Throws std::invalid_argument if an operand does not
    /// come before its node, is the operand of two, or if a window is none.
    int formula(const std::vector<FormulaNode> &nodes);

    /// Up to Instants::most samples, later than those before. margins: of each atom a row of Instants::most numbers,
    /// NaN where it has no value; unknown: of each atom 0 if there is no NaN.
    void take(std::span<const Ns> times, const double *margins, const unsigned char *unknown);
    /// There is no sample after t: what windows that reach further need is unknown.
    void finish(Ns t);
    void reset();

    /// A formula's value at the first sample, by what has come so far.
    Robustness value(int formula) const;
    bool violated() const; ///< whether one of the formulas is

private:
    struct Sample {
        Ns t;
        Robustness value;
    };
    struct Pair { ///< of both operands
        Ns t;
        Robustness value, other;
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
    struct Bound { ///< of a sample; where its value is known, both of its bounds
        Ns t;
        double value;
        Witness at;
    };
    struct Role { ///< of a node in its formula
        FormulaNode what;
        int instant = -1; ///< the part that it is; only of such a node
        int parent = -1;
        /// Of a window of a part: its parent's other operand, if that is a part; the window then passes that part's
        /// samples to the parent, too. Of that part: the window.
        int beside = -1;
        bool second = false; ///< it is its parent's second operand
        bool front = false;  ///< only its value at the first sample counts
        Ns wanted = no_end;  ///< its value counts until so long after the first sample
    };
    struct Window {               ///< of ALWAYS and EVENTUALLY
        Queue<Ns> pending;        ///< samples at which the value is not known yet
        Queue<Bound> lows, highs; ///< monotonic: the least bound from each sample on
        bool split = false;       ///< a sample in lows has another upper bound, so that highs counts, too
        Ns unknown = -1;          ///< the last such sample
    };
    struct Operands {             ///< of AND, OR and UNTIL
        Queue<Pair> waiting;      ///< for the other operand
        std::size_t here[2] = {}; ///< how many of those have each operand
        Queue<Pair> samples;      ///< of UNTIL: both operands are known
    };
    struct Node : Role, Window, Operands {
        bool passed = false;       ///< of a front node: its window lies before the newest sample
        Robustness value;          ///< of a front node what it has gathered; of ONCE the greatest so far
        Robustness before;         ///< of BEGINS at the sample before; of UNTIL in front the first operand so far
        std::vector<Sample> given; ///< what it gives at once
        std::vector<Bound> bounds; ///< the same, where a window has known numbers
    };
    struct PartOperand;
    struct SampleOperand;
    struct BoundOperand;

    void restart(Node &node) const;
    const Node *least_of_joined(const Node &node) const;
    bool wait(Node &node, Ns t, std::size_t k);
    void wait_no_more(Node &node);
    template <class Operand> void take_window(Node &node, const Operand &samples);
    template <class Operand> void gather(Node &node, const Operand &samples);
    template <class Operand> void push_known(Node &node, const Operand &samples, Ns last);
    void gather_until(Node &node, const Pair &pair);
    void take(Node &node, bool second, std::span<const Sample> samples);
    void join(Node &node, bool second, std::span<const Sample> samples);
    void give(Node &node);
    void give_windows(Node &node, Ns before);
    void give_until(Node &node, Ns before);
    void close(Node &node);
    Robustness front(const Node &node) const;
    Node &at(int node) { return nodes_[static_cast<std::size_t>(node)]; }
    const Node &at(int node) const { return nodes_[static_cast<std::size_t>(node)]; }

    Instants instants_;
    std::vector<Node> nodes_; ///< of all formulas
    std::vector<int> roots_;  ///< of each formula
    Ns first_ = -1;
    Ns end_ = -1; ///< -1: not finished
};

} // namespace fledge::sim

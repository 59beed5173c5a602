// SPDX-License-Identifier: Apache-2.0
#include "sim/temporal.h"

#include <algorithm>
#include <stdexcept>

namespace fledge::sim {

namespace {

constexpr Robustness true_now{unbounded, unbounded, {}, {}};
constexpr Robustness false_now{-unbounded, -unbounded, {}, {}};

bool binary(FormulaNode::Kind kind)
{
    return kind == FormulaNode::AND || kind == FormulaNode::OR || kind == FormulaNode::UNTIL;
}

bool leaf(FormulaNode::Kind kind)
{
    return kind == FormulaNode::ATOM || kind == FormulaNode::CONSTANT || kind == FormulaNode::CLOCK;
}

Ns after(Ns t, Ns duration)
{
    return duration > no_end - std::max<Ns>(t, 0) ? no_end : t + duration;
}

/// EVENTUALLY is the dual of ALWAYS: not always not.
Robustness turned(const FormulaNode &what, const Robustness &value)
{
    return what.kind == FormulaNode::EVENTUALLY ? -value : value;
}

} // namespace

Robustness least(const Robustness &a, const Robustness &b)
{
    const auto less = [](double y, const Witness &of_y, double x, const Witness &of_x) {
        return y < x || (y == x && of_y.unknown && !of_x.unknown);
    };
    const bool low = less(b.low, b.at_low, a.low, a.at_low), high = less(b.high, b.at_high, a.high, a.at_high);
    return {low ? b.low : a.low, high ? b.high : a.high, low ? b.at_low : a.at_low, high ? b.at_high : a.at_high};
}

Robustness greatest(const Robustness &a, const Robustness &b)
{
    return -least(-a, -b);
}

TemporalMonitor::TemporalMonitor(std::vector<FormulaNode> nodes)
{
    for (std::size_t i = 0; i < nodes.size(); i++) {
        const FormulaNode &what = nodes[i];
        Node node;
        node.what = what;
        node.instant =
            what.kind != FormulaNode::ALWAYS && what.kind != FormulaNode::EVENTUALLY && what.kind != FormulaNode::UNTIL;
        const auto operand = [&](int at, bool second) {
            if (at < 0 || static_cast<std::size_t>(at) >= i || nodes_[static_cast<std::size_t>(at)].parent >= 0) {
                throw std::invalid_argument("a node of a formula has no operand of its own before it");
            }
            Node &child = nodes_[static_cast<std::size_t>(at)];
            child.parent = static_cast<int>(i);
            child.second = second;
            node.instant = node.instant && child.instant;
        };
        if (!leaf(what.kind)) {
            operand(what.a, false);
        }
        if (binary(what.kind)) {
            operand(what.b, true);
        }
        if (what.from < 0 || what.to < what.from) {
            throw std::invalid_argument("a window of a formula ends before it begins");
        }
        nodes_.push_back(std::move(node));
    }
    if (nodes_.empty()) {
        throw std::invalid_argument("a formula has no node");
    }
    for (std::size_t i = nodes_.size(); i-- > 0;) {
        Node &node = nodes_[i];
        const bool last = i + 1 == nodes_.size();
        if (!last && node.parent < 0) {
            throw std::invalid_argument("a node of a formula is no operand");
        }
        const Node *parent = last ? nullptr : &nodes_[static_cast<std::size_t>(node.parent)];
        node.front = last || (parent->front && parent->what.kind != FormulaNode::ALWAYS &&
                              parent->what.kind != FormulaNode::EVENTUALLY && parent->what.kind != FormulaNode::UNTIL);
    }
    reset();
}

void TemporalMonitor::reset()
{
    first_ = end_ = -1;
    instants_.clear();
    for (std::size_t i = 0; i < nodes_.size(); i++) {
        Node &node = nodes_[i];
        Node anew;
        anew.what = node.what;
        anew.parent = node.parent, anew.second = node.second, anew.instant = node.instant, anew.front = node.front;
        switch (node.what.kind) {
        case FormulaNode::ALWAYS:
        case FormulaNode::EVENTUALLY: anew.value = true_now; break; // of the negation
        case FormulaNode::UNTIL: anew.value = false_now, anew.before = true_now; break;
        case FormulaNode::ONCE: anew.value = false_now; break;
        default: break;
        }
        node = std::move(anew);
        if (node.instant) {
            instants_.push_back(static_cast<int>(i));
        }
    }
}

void TemporalMonitor::step(Ns t, std::span<const Robustness> atoms)
{
    const bool begins = first_ < 0;
    if (begins) {
        first_ = t;
    }
    for (const int i : instants_) {
        Node &node = nodes_[static_cast<std::size_t>(i)];
        evaluate(node, t, atoms);
        if (!node.front) {
            Node &parent = nodes_[static_cast<std::size_t>(node.parent)];
            if (!parent.instant) {
                take(parent, node.second, t, node.value);
            }
        }
    }
    if (begins) { // of instant nodes in front, the first value is all that counts
        std::erase_if(instants_, [&](int i) { return nodes_[static_cast<std::size_t>(i)].front; });
    }
}

/// The value of an instant node at a sample.
void TemporalMonitor::evaluate(Node &node, Ns t, std::span<const Robustness> atoms)
{
    const FormulaNode &what = node.what;
    const auto of = [&](int i) -> const Robustness & { return nodes_[static_cast<std::size_t>(i)].value; };
    switch (what.kind) {
    case FormulaNode::ATOM: node.value = atoms[static_cast<std::size_t>(what.a)]; break;
    case FormulaNode::CONSTANT: node.value = what.a ? true_now : false_now; break;
    case FormulaNode::CLOCK: node.value = t >= what.from ? true_now : false_now; break;
    case FormulaNode::NOT: node.value = -of(what.a); break;
    case FormulaNode::AND: node.value = least(of(what.a), of(what.b)); break;
    case FormulaNode::OR: node.value = greatest(of(what.a), of(what.b)); break;
    case FormulaNode::ONCE: node.value = greatest(node.value, of(what.a)); break;
    case FormulaNode::BEGINS: {
        const Robustness now = of(what.a);
        node.value = node.started ? least(now, -node.before) : now;
        node.before = now;
        node.started = true;
        break;
    }
    default: break;
    }
}

/// The value of an operand at a sample, in the order of samples.
void TemporalMonitor::take(Node &node, bool second, Ns t, const Robustness &value)
{
    switch (node.what.kind) {
    case FormulaNode::ALWAYS:
    case FormulaNode::EVENTUALLY:
        if (node.front) {
            gather(node, t, turned(node.what, value), {});
        } else {
            take_window(node, t, turned(node.what, value));
        }
        break;
    case FormulaNode::NOT: give(node, t, -value); break;
    case FormulaNode::ONCE:
        node.value = greatest(node.value, value);
        give(node, t, node.value);
        break;
    case FormulaNode::BEGINS: {
        const Robustness found = node.started ? least(value, -node.before) : value;
        node.before = value;
        node.started = true;
        give(node, t, found);
        break;
    }
    default: join(node, second, t, value); break;
    }
}

/// One of two operands: the other may be known earlier or later.
void TemporalMonitor::join(Node &node, bool second, Ns t, const Robustness &value)
{
    std::size_t &filled = node.here[second];
    if (filled == node.waiting.size()) {
        node.waiting.push({t, value, value});
    } else {
        Sample &sample = node.waiting[filled];
        (second ? sample.other : sample.value) = value;
    }
    filled++;
    if (node.here[0] == 0 || node.here[1] == 0) {
        return;
    }
    const Sample whole = node.waiting.front();
    node.waiting.pop();
    node.here[0]--, node.here[1]--;
    if (node.what.kind == FormulaNode::AND) {
        give(node, whole.t, least(whole.value, whole.other));
    } else if (node.what.kind == FormulaNode::OR) {
        give(node, whole.t, greatest(whole.value, whole.other));
    } else if (node.front) {
        gather(node, whole.t, whole.value, whole.other);
    } else {
        give_until(node, whole.t);
        node.samples.push(whole);
    }
}

void TemporalMonitor::give(const Node &node, Ns t, const Robustness &value)
{
    if (!node.front) {
        take(nodes_[static_cast<std::size_t>(node.parent)], node.second, t, value);
    }
}

/// A sample for the window from the first sample on. other: of UNTIL, whose first operand is the value.
void TemporalMonitor::gather(Node &node, Ns t, const Robustness &value, const Robustness &other)
{
    if (t > after(first_, node.what.to)) {
        node.passed = true;
    } else if (node.what.kind == FormulaNode::UNTIL) {
        node.value = greatest(node.value, least(other, node.before));
        node.before = least(node.before, value);
    } else if (t >= first_ + node.what.from) {
        node.value = least(node.value, value);
    }
}

/// A sample for windows that begin at each sample.
void TemporalMonitor::take_window(Node &node, Ns t, const Robustness &value)
{
    if (node.what.to == no_end) {
        node.samples.push({t, value, {}});
        return;
    }
    give_windows(node, t);
    node.pending.push(t);
    const auto push = [t](Queue<Bound> &bounds, double bound, const Witness &at) {
        while (!bounds.empty() && bounds.back().value > bound) {
            bounds.pop_back();
        }
        bounds.push({t, bound, at});
    };
    push(node.lows, value.low, value.at_low);
    push(node.highs, value.high, value.at_high);
}

/// Give the values of windows that end before this time, whose samples have all come; no_end: of all windows.
void TemporalMonitor::give_windows(Node &node, Ns before)
{
    const auto least_of = [](Queue<Bound> &bounds, Ns from) {
        while (!bounds.empty() && bounds.front().t < from) {
            bounds.pop();
        }
        return bounds.empty() ? Bound{-1, unbounded, {}} : bounds.front();
    };
    while (!node.pending.empty() && (before == no_end || after(node.pending.front(), node.what.to) < before)) {
        const Ns t = node.pending.front();
        node.pending.pop();
        const Bound low = least_of(node.lows, t + node.what.from), high = least_of(node.highs, t + node.what.from);
        const bool whole = before != no_end || after(t, node.what.to) <= end_;
        const Robustness value{whole ? low.value : -unbounded, high.value, whole ? low.at : Witness{}, high.at};
        give(node, t, turned(node.what, value));
    }
}

/// The same of UNTIL with a window.
void TemporalMonitor::give_until(Node &node, Ns before)
{
    if (node.what.to == no_end) {
        return;
    }
    while (!node.samples.empty() && (before == no_end || after(node.samples.front().t, node.what.to) < before)) {
        const Ns t = node.samples.front().t, last = after(t, node.what.to);
        Robustness value = false_now, first = true_now;
        for (std::size_t i = 0; i < node.samples.size() && node.samples[i].t <= last; i++) {
            value = greatest(value, least(node.samples[i].other, first));
            first = least(first, node.samples[i].value);
        }
        if (before == no_end && last > end_ && first.high > value.high) {
            value.high = first.high, value.at_high = first.at_high;
        }
        node.samples.pop();
        give(node, t, value);
    }
}

void TemporalMonitor::finish(Ns t)
{
    end_ = t;
    for (Node &node : nodes_) {
        close(node);
    }
}

/// Give what waits for samples that do not come.
void TemporalMonitor::close(Node &node)
{
    const FormulaNode &what = node.what;
    if (node.front) {
        return;
    }
    if (what.kind == FormulaNode::UNTIL && what.to != no_end) {
        give_until(node, no_end);
    } else if (what.to != no_end) {
        give_windows(node, no_end);
    } else if (!node.samples.empty()) { // without an end: from the last sample back
        std::vector<Robustness> values(node.samples.size());
        Robustness value = what.kind == FormulaNode::UNTIL ? false_now : true_now;
        std::size_t in = values.size(); // the samples from here on are in the window
        for (std::size_t i = values.size(); i-- > 0;) {
            const Sample &sample = node.samples[i];
            if (what.kind == FormulaNode::UNTIL) {
                value = greatest(sample.other, least(sample.value, value));
            } else {
                while (in > 0 && node.samples[in - 1].t >= after(sample.t, what.from)) {
                    value = least(node.samples[--in].value, value);
                }
            }
            values[i] = turned(what, value);
        }
        for (std::size_t i = 0; i < values.size(); i++) {
            give(node, node.samples[i].t, values[i]);
        }
        node.samples.clear();
    }
}

Robustness TemporalMonitor::value() const
{
    return first_ < 0 ? Robustness{} : front(nodes_.back());
}

/// The value of a front node at the first sample, by what has come.
Robustness TemporalMonitor::front(const Node &node) const
{
    const FormulaNode &what = node.what;
    const auto of = [&](int i) { return front(nodes_[static_cast<std::size_t>(i)]); };
    if (node.instant) {
        return node.value;
    }
    const bool whole = node.passed || (end_ >= 0 && (what.to == no_end || after(first_, what.to) <= end_));
    Robustness value = node.value;
    switch (what.kind) {
    case FormulaNode::NOT: return -of(what.a);
    case FormulaNode::AND: return least(of(what.a), of(what.b));
    case FormulaNode::OR: return greatest(of(what.a), of(what.b));
    case FormulaNode::ONCE:
    case FormulaNode::BEGINS: return of(what.a); // no sample comes before
    case FormulaNode::UNTIL:
        if (!whole && node.before.high > value.high) {
            value.high = node.before.high, value.at_high = node.before.at_high;
        }
        return value;
    default:
        if (!whole) {
            value.low = -unbounded, value.at_low = {};
        }
        return turned(what, value);
    }
}

} // namespace fledge::sim

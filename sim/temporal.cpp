// SPDX-License-Identifier: Apache-2.0
#include "sim/temporal.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fledge::sim {

namespace {

bool binary(FormulaNode::Kind kind)
{
    return kind == FormulaNode::AND || kind == FormulaNode::OR || kind == FormulaNode::UNTIL;
}

bool leaf(FormulaNode::Kind kind)
{
    return kind == FormulaNode::ATOM || kind == FormulaNode::CONSTANT || kind == FormulaNode::CLOCK;
}

bool window(FormulaNode::Kind kind)
{
    return kind == FormulaNode::ALWAYS || kind == FormulaNode::EVENTUALLY || kind == FormulaNode::UNTIL;
}

bool dual(FormulaNode::Kind a, FormulaNode::Kind b)
{
    return (a == FormulaNode::ALWAYS && b == FormulaNode::EVENTUALLY) ||
           (a == FormulaNode::EVENTUALLY && b == FormulaNode::ALWAYS);
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

/// The least bound of an operand. Eight at a time do not wait for each other.
double least_bound(const auto &samples, std::size_t from, std::size_t to, bool high)
{
    if (to - from == 1) {
        return samples.bound(from, high);
    }
    double found[8];
    std::fill_n(found, 8, unbounded);
    for (; from + 8 <= to; from += 8) {
        for (std::size_t i = 0; i < 8; i++) {
            const double x = samples.bound(from + i, high);
            found[i] = x < found[i] ? x : found[i];
        }
    }
    for (; from < to; from++) {
        found[0] = std::min(found[0], samples.bound(from, high));
    }
    return *std::min_element(found, found + 8);
}

} // namespace

/// What an operand of a window gives it: a part at the samples of a block.
struct TemporalMonitor::PartOperand {
    const Instants &instants;
    int part;
    bool turned;
    const double *lows, *highs;

    PartOperand(Instants &of, int number, bool is_turned) : instants(of), part(number), turned(is_turned)
    {
        const Instants::Column &column = of.column(part);
        lows = turned ? column.high : column.low;
        highs = turned ? column.low : column.high;
    }
    std::size_t size() const { return instants.times().size(); }
    Ns t(std::size_t k) const { return instants.times()[k]; }
    bool known() const { return lows == highs; }
    double bound(std::size_t k, bool high) const
    {
        const double x = (high ? highs : lows)[k];
        return turned ? -x : x;
    }
    Witness at(std::size_t k, bool high) const { return instants.witness(part, k, high != turned); }
};

/// The same of what another node has given.
struct TemporalMonitor::SampleOperand {
    std::span<const Sample> samples;
    bool turned;

    std::size_t size() const { return samples.size(); }
    Ns t(std::size_t k) const { return samples[k].t; }
    bool known() const { return false; }
    double bound(std::size_t k, bool high) const
    {
        return turned ? -(high ? samples[k].value.low : samples[k].value.high)
                      : (high ? samples[k].value.high : samples[k].value.low);
    }
    const Witness &at(std::size_t k, bool high) const
    {
        return high != turned ? samples[k].value.at_high : samples[k].value.at_low;
    }
};

struct TemporalMonitor::BoundOperand {
    std::span<const Bound> bounds;
    bool turned;

    std::size_t size() const { return bounds.size(); }
    Ns t(std::size_t k) const { return bounds[k].t; }
    bool known() const { return true; }
    double bound(std::size_t k, bool) const { return turned ? -bounds[k].value : bounds[k].value; }
    const Witness &at(std::size_t k, bool) const { return bounds[k].at; }
};

int TemporalMonitor::formula(const std::vector<FormulaNode> &nodes)
{
    std::vector<int> parents(nodes.size(), -1);
    for (std::size_t i = 0; i < nodes.size(); i++) {
        const auto operand = [&](int of) {
            if (of < 0 || static_cast<std::size_t>(of) >= i || parents[static_cast<std::size_t>(of)] >= 0) {
                throw std::invalid_argument("a node of a formula has no operand of its own before it");
            }
            parents[static_cast<std::size_t>(of)] = static_cast<int>(i);
        };
        if (!leaf(nodes[i].kind)) {
            operand(nodes[i].a);
        }
        if (binary(nodes[i].kind)) {
            operand(nodes[i].b);
        }
        if (nodes[i].from < 0 || nodes[i].to < nodes[i].from) {
            throw std::invalid_argument("a window of a formula ends before it begins");
        }
    }
    if (nodes.empty()) {
        throw std::invalid_argument("a formula has no node");
    }
    if (std::count(parents.begin(), parents.end(), -1) > 1) {
        throw std::invalid_argument("a node of a formula is no operand");
    }

    const std::size_t begin = nodes_.size();
    struct Place {
        bool instant; ///< it has a value at a sample at once, and so have its operands
        int number;   ///< of its part, else of its node
    };
    std::vector<Place> places;
    const auto place = [&](int i) -> const Place & { return places[static_cast<std::size_t>(i)]; };
    const auto node_of = [&](int i) {
        if (!place(i).instant) {
            return place(i).number;
        }
        nodes_.emplace_back().instant = place(i).number;
        return static_cast<int>(nodes_.size()) - 1;
    };
    for (FormulaNode what : nodes) {
        const bool has_a = !leaf(what.kind), has_b = binary(what.kind);
        const bool instant =
            !window(what.kind) && (!has_a || place(what.a).instant) && (!has_b || place(what.b).instant);
        if (has_a) {
            what.a = instant ? place(what.a).number : node_of(what.a);
        }
        if (has_b) {
            what.b = instant ? place(what.b).number : node_of(what.b);
        }
        if (instant) {
            places.push_back({true, instants_.add(what)});
            continue;
        }
        const int number = static_cast<int>(nodes_.size());
        nodes_.emplace_back().what = what;
        at(what.a).parent = number;
        if (has_b) {
            at(what.b).parent = number;
            at(what.b).second = true;
        }
        places.push_back({false, number});
    }
    roots_.push_back(node_of(static_cast<int>(nodes.size()) - 1));
    for (std::size_t i = nodes_.size(); i-- > begin;) {
        Node &node = nodes_[i];
        const Node *parent = node.parent < 0 ? nullptr : &at(node.parent);
        const bool in_window = parent && window(parent->what.kind);
        node.front = !parent || (parent->front && !in_window);
        node.wanted = !parent ? 0 : in_window ? after(parent->wanted, parent->what.to) : parent->wanted;
        restart(node);
    }
    for (std::size_t i = begin; i < nodes_.size(); i++) {
        const Node &joined = nodes_[i];
        if ((joined.what.kind != FormulaNode::OR && joined.what.kind != FormulaNode::AND) || joined.front) {
            continue;
        }
        const Node &parent = at(joined.parent);
        const auto kind = joined.what.kind == FormulaNode::OR ? FormulaNode::ALWAYS : FormulaNode::EVENTUALLY;
        if (!parent.front || parent.what.kind != kind || parent.what.to != no_end) {
            continue;
        }
        for (const auto &[a, b] : {std::pair{joined.what.a, joined.what.b}, std::pair{joined.what.b, joined.what.a}}) {
            Node &part = at(a), &node = at(b);
            if (part.instant >= 0 &&
                (node.what.kind == FormulaNode::ALWAYS || node.what.kind == FormulaNode::EVENTUALLY) &&
                at(node.what.a).instant >= 0) {
                node.beside = a;
                part.beside = b;
            }
        }
    }
    return static_cast<int>(roots_.size()) - 1;
}

/// Of a window with a part beside it: the window from the first sample on that takes the least of what joins the two,
/// or of the negation. A sample counts there only if its part and its window are below what that has gathered.
const TemporalMonitor::Node *TemporalMonitor::least_of_joined(const Node &node) const
{
    return node.beside < 0 ? nullptr : &at(at(node.parent).parent);
}

/// A sample's window waits for later samples, and so does what is beside it. Returns false if it does not count.
bool TemporalMonitor::wait(Node &node, Ns t, std::size_t k)
{
    if (const Node *least = least_of_joined(node)) {
        const Node &part = at(node.beside);
        const Instants::Column &column = instants_.column(part.instant);
        if ((least->what.kind == FormulaNode::ALWAYS ? column.low[k] : -column.high[k]) >= least->value.high) {
            return false;
        }
        Node &joined = at(node.parent);
        const Robustness value = instants_.at(part.instant, k);
        joined.waiting.push({t, value, value});
        joined.here[part.second]++;
    }
    node.pending.push(t);
    return true;
}

/// The windows that wait do not count.
void TemporalMonitor::wait_no_more(Node &node)
{
    if (node.beside >= 0) {
        Node &joined = at(node.parent);
        joined.here[at(node.beside).second] -= node.pending.size();
        for (std::size_t i = node.pending.size(); i > 0; i--) {
            joined.waiting.pop_back();
        }
    }
    node.pending.clear();
}

void TemporalMonitor::restart(Node &node) const
{
    Node anew;
    static_cast<Role &>(anew) = node;
    const bool least_yet = node.what.kind == FormulaNode::ALWAYS || node.what.kind == FormulaNode::EVENTUALLY;
    anew.value = least_yet ? true_always : false_always; // of EVENTUALLY: of the negation
    anew.before = node.what.kind == FormulaNode::UNTIL ? true_always : false_always;
    node = std::move(anew);
}

void TemporalMonitor::reset()
{
    first_ = end_ = -1;
    instants_.reset();
    for (Node &node : nodes_) {
        restart(node);
    }
}

void TemporalMonitor::take(std::span<const Ns> times, const double *margins, const unsigned char *unknown)
{
    if (times.empty()) {
        return;
    }
    const bool begins = first_ < 0;
    if (begins) {
        first_ = times.front();
    }
    instants_.take(times, margins, unknown);
    for (Node &node : nodes_) {
        if (node.instant < 0) {
            continue;
        }
        if (node.front) { // the first value is all that counts
            if (begins) {
                node.value = instants_.at(node.instant, 0);
            }
            continue;
        }
        Node &parent = at(node.parent);
        if (node.beside >= 0) { // the window beside it has given what counts
            instants_.column(node.instant);
            continue;
        }
        if (parent.front && parent.passed) {
            continue;
        }
        if (parent.what.kind == FormulaNode::ALWAYS || parent.what.kind == FormulaNode::EVENTUALLY) {
            take_window(parent, PartOperand(instants_, node.instant, parent.what.kind == FormulaNode::EVENTUALLY));
            continue;
        }
        node.given.clear();
        for (std::size_t k = 0; k < times.size(); k++) {
            node.given.push_back({times[k], instants_.at(node.instant, k)});
        }
        give(node);
    }
}

/// Values of an operand at samples, in the order of samples.
void TemporalMonitor::take(Node &node, bool second, std::span<const Sample> samples)
{
    switch (node.what.kind) {
    case FormulaNode::ALWAYS:
    case FormulaNode::EVENTUALLY:
        take_window(node, SampleOperand{samples, node.what.kind == FormulaNode::EVENTUALLY});
        return;
    case FormulaNode::NOT:
        for (const Sample &sample : samples) {
            node.given.push_back({sample.t, -sample.value});
        }
        break;
    case FormulaNode::ONCE:
        for (const Sample &sample : samples) {
            node.value = greatest(node.value, sample.value);
            node.given.push_back({sample.t, node.value});
        }
        break;
    case FormulaNode::BEGINS:
        for (const Sample &sample : samples) {
            node.given.push_back({sample.t, least(sample.value, -node.before)});
            node.before = sample.value;
        }
        break;
    default: join(node, second, samples); break;
    }
    give(node);
}

/// One of two operands: the other may be known earlier or later.
void TemporalMonitor::join(Node &node, bool second, std::span<const Sample> samples)
{
    for (const Sample &given : samples) {
        std::size_t &filled = node.here[second];
        if (filled == node.waiting.size()) {
            node.waiting.push({given.t, given.value, given.value});
        } else {
            (second ? node.waiting[filled].other : node.waiting[filled].value) = given.value;
        }
        filled++;
        if (node.here[0] == 0 || node.here[1] == 0) {
            continue;
        }
        const Pair whole = node.waiting.front();
        node.waiting.pop();
        node.here[0]--, node.here[1]--;
        if (node.what.kind == FormulaNode::AND) {
            node.given.push_back({whole.t, least(whole.value, whole.other)});
        } else if (node.what.kind == FormulaNode::OR) {
            node.given.push_back({whole.t, greatest(whole.value, whole.other)});
        } else if (node.front) {
            gather_until(node, whole);
        } else {
            give_until(node, whole.t);
            node.samples.push(whole);
        }
    }
}

void TemporalMonitor::give(Node &node)
{
    if (node.front) {
        return;
    }
    Node &parent = at(node.parent);
    if (!node.bounds.empty()) {
        const bool eventually = parent.what.kind == FormulaNode::EVENTUALLY;
        if (eventually || parent.what.kind == FormulaNode::ALWAYS) {
            take_window(parent, BoundOperand{node.bounds, eventually});
        } else {
            for (const Bound &bound : node.bounds) {
                node.given.push_back({bound.t, Robustness::known(bound.value, bound.at)});
            }
        }
        node.bounds.clear();
    }
    if (!node.given.empty()) {
        take(parent, node.second, node.given);
        node.given.clear();
    }
}

/// Samples for a window: of those in front there is one, from the first sample on; of others one from each sample on.
template <class Operand> void TemporalMonitor::take_window(Node &node, const Operand &samples)
{
    if (node.front) {
        gather(node, samples);
        return;
    }
    const Ns last = after(first_, node.wanted), tail = after(last, node.what.from);
    if (!samples.known()) {
        node.highs = node.split ? std::move(node.highs) : node.lows;
        node.split = true;
        node.unknown = samples.t(samples.size() - 1);
    } else if (node.split && (node.pending.empty() || after(node.pending.front(), node.what.from) > node.unknown)) {
        node.split = false;
        node.highs.clear();
    }
    const bool endless = node.what.to == no_end;
    const auto push = [&](Queue<Bound> &bounds, std::size_t k, bool high) {
        const Bound added{samples.t(k), samples.bound(k, high), samples.at(k, high)};
        while (!bounds.empty() && (endless ? less(added.value, added.at, bounds.back().value, bounds.back().at)
                                           : added.value < bounds.back().value)) {
            bounds.pop_back();
        }
        bounds.push(added);
    };
    if (endless && !node.split && samples.t(0) > tail) { // each window that counts has all of these samples
        const double found = least_bound(samples, 0, samples.size(), false);
        if (node.lows.empty() || node.lows.back().t <= tail || found < node.lows.back().value) {
            std::size_t k = 0;
            while (samples.bound(k, false) != found) {
                k++;
            }
            push(node.lows, k, false);
        }
        return;
    }
    if (!node.split) {
        push_known(node, samples, endless ? last : no_end);
        give(node);
        return;
    }
    for (std::size_t k = 0; k < samples.size(); k++) {
        const Ns t = samples.t(k);
        give_windows(node, t);
        if (!endless || t <= last) {
            wait(node, t, k);
        }
        push(node.lows, k, false);
        push(node.highs, k, true);
    }
    give(node);
}

/// The same where all that counts is known. The witness of a bound is found only if the bound is given, or outlasts the
/// samples; till then its atom is the place of its sample.
template <class Operand> void TemporalMonitor::push_known(Node &node, const Operand &samples, Ns last)
{
    const Ns from = node.what.from, to = node.what.to, first = samples.t(0);
    const double sign = node.what.kind == FormulaNode::EVENTUALLY ? -1.0 : 1.0;
    Queue<Bound> &lows = node.lows;
    // The other kind of window, from the first sample on, takes no value that is above its own: a window with a sample
    // this low need not be looked through.
    const Node *joined = least_of_joined(node);
    const Node &least_of = joined ? *joined : at(node.parent);
    const bool skips =
        from == 0 && least_of.front && least_of.what.to == no_end && dual(least_of.what.kind, node.what.kind);
    const double low_enough = skips ? -least_of.value.high : -unbounded;
    for (std::size_t k = 0; k < samples.size(); k++) {
        const Ns t = samples.t(k);
        while (!node.pending.empty() && after(node.pending.front(), to) < t) {
            const Ns begin = node.pending.front();
            node.pending.pop();
            while (!lows.empty() && lows.front().t < begin + from) {
                lows.pop();
            }
            if (lows.empty()) {
                node.bounds.push_back({begin, sign * unbounded, {}});
                continue;
            }
            const Bound &least = lows.front();
            const Witness at = least.t < first ? least.at : samples.at(static_cast<std::size_t>(least.at.atom), false);
            node.bounds.push_back({begin, sign * least.value, at});
        }
        const double x = samples.bound(k, false);
        if (skips && x <= low_enough) {
            wait_no_more(node);
            lows.clear();
            continue;
        }
        if (t <= last && !wait(node, t, k) && node.pending.empty()) {
            lows.clear(); // no window that counts has this sample
            continue;
        }
        while (!lows.empty() && x < lows.back().value) {
            lows.pop_back();
        }
        lows.push({t, x, {-1, static_cast<int>(k), false}});
    }
    for (std::size_t i = lows.size(); i-- > 0 && lows[i].t >= first;) {
        lows[i].at = samples.at(static_cast<std::size_t>(lows[i].at.atom), false);
    }
}

/// The least bounds of the window from the first sample on.
template <class Operand> void TemporalMonitor::gather(Node &node, const Operand &samples)
{
    std::size_t from = 0, to = samples.size();
    for (const Ns end = after(first_, node.what.to); to > 0 && samples.t(to - 1) > end; to--) {
        node.passed = true;
    }
    while (from < to && samples.t(from) < first_ + node.what.from) {
        from++;
    }
    if (from == to) {
        return;
    }
    const auto lower = [&](double &bound, Witness &at, double found, bool high) {
        const bool one_decides = samples.known() || std::isfinite(found); // and not rather one without a value
        bool first = found < bound;
        if (!first && (found > bound || one_decides || at.unknown)) {
            return;
        }
        bound = found;
        for (std::size_t k = from; k < to; k++) {
            if (samples.bound(k, high) != found) {
                continue;
            }
            const Witness witness = samples.at(k, high);
            if (first || witness.unknown) {
                at = witness;
                first = false;
            }
            if (one_decides || witness.unknown) {
                return;
            }
        }
    };
    const double low = least_bound(samples, from, to, false);
    lower(node.value.low, node.value.at_low, low, false);
    lower(node.value.high, node.value.at_high, samples.known() ? low : least_bound(samples, from, to, true), true);
}

/// A sample for an UNTIL from the first sample on.
void TemporalMonitor::gather_until(Node &node, const Pair &pair)
{
    if (pair.t > after(first_, node.what.to)) {
        node.passed = true;
    } else {
        node.value = greatest(node.value, least(pair.other, node.before));
        node.before = least(node.before, pair.value);
    }
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
        const Bound low = least_of(node.lows, t + node.what.from);
        const Bound high = node.split ? least_of(node.highs, t + node.what.from) : low;
        const bool whole = before != no_end || node.what.to == no_end || after(t, node.what.to) <= end_;
        const Robustness value{whole ? low.value : -unbounded, high.value, whole ? low.at : Witness{}, high.at};
        node.given.push_back({t, turned(node.what, value)});
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
        Robustness value = false_always, first = true_always;
        for (std::size_t i = 0; i < node.samples.size() && node.samples[i].t <= last; i++) {
            value = greatest(value, least(node.samples[i].other, first));
            first = least(first, node.samples[i].value);
        }
        if (before == no_end && last > end_ && first.high > value.high) {
            value.high = first.high, value.at_high = first.at_high;
        }
        node.samples.pop();
        node.given.push_back({t, value});
    }
}

void TemporalMonitor::finish(Ns t)
{
    end_ = t;
    for (Node &node : nodes_) {
        if (!node.front && window(node.what.kind)) {
            close(node);
            give(node);
        }
    }
}

/// Give what waits for samples that do not come.
void TemporalMonitor::close(Node &node)
{
    if (node.what.kind != FormulaNode::UNTIL) {
        give_windows(node, no_end);
        if (node.what.to == no_end) {
            node.lows.clear();
            node.highs.clear();
        }
    } else if (node.what.to != no_end) {
        give_until(node, no_end);
    } else { // without an end: from the last sample back
        const std::size_t n = node.samples.size();
        node.given.resize(n);
        Robustness value = false_always;
        for (std::size_t i = n; i-- > 0;) {
            value = greatest(node.samples[i].other, least(node.samples[i].value, value));
            node.given[i] = {node.samples[i].t, value};
        }
        node.samples.clear();
    }
}

Robustness TemporalMonitor::value(int formula) const
{
    return first_ < 0 ? Robustness{} : front(at(roots_[static_cast<std::size_t>(formula)]));
}

bool TemporalMonitor::violated() const
{
    for (const int root : roots_) {
        const Node &node = at(root);
        const bool gathers = node.what.kind == FormulaNode::ALWAYS; // its upper bound is what it has gathered
        if (first_ >= 0 && (gathers ? node.value.high : front(node).high) < 0.0) {
            return true;
        }
    }
    return false;
}

/// The value of a front node at the first sample, by what has come.
Robustness TemporalMonitor::front(const Node &node) const
{
    const FormulaNode &what = node.what;
    const auto of = [&](int i) { return front(at(i)); };
    if (node.instant >= 0) {
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

// SPDX-License-Identifier: Apache-2.0
#include "sim/instants.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace fledge::sim {

namespace {

using Numbers = std::array<double, Instants::most>;

constexpr Numbers filled(double x)
{
    Numbers numbers{};
    numbers.fill(x);
    return numbers;
}

constexpr Numbers all_true = filled(unbounded), all_false = filled(-unbounded);

Instants::Column constant(bool holds)
{
    const double *numbers = holds ? all_true.data() : all_false.data();
    return {numbers, numbers, holds ? 1 : -1};
}

bool same(const Witness &a, const Witness &b)
{
    return a.t == b.t && a.atom == b.atom && a.unknown == b.unknown;
}

bool known(const Robustness &value)
{
    return value.low == value.high && same(value.at_low, value.at_high);
}

void lesser(double *to, const double *a, const double *b, std::size_t n)
{
    for (std::size_t k = 0; k < n; k++) {
        to[k] = b[k] < a[k] ? b[k] : a[k];
    }
}

void larger(double *to, const double *a, const double *b, std::size_t n)
{
    for (std::size_t k = 0; k < n; k++) {
        to[k] = b[k] > a[k] ? b[k] : a[k];
    }
}

void negative(double *to, const double *a, std::size_t n)
{
    for (std::size_t k = 0; k < n; k++) {
        to[k] = -a[k];
    }
}

} // namespace

int Instants::add(FormulaNode what)
{
    if (what.kind == FormulaNode::NOT && parts_[static_cast<std::size_t>(what.a)].what.kind == FormulaNode::NOT) {
        return parts_[static_cast<std::size_t>(what.a)].what.a;
    }
    for (std::size_t i = 0; i < parts_.size(); i++) {
        if (parts_[i].what == what) {
            return static_cast<int>(i);
        }
    }
    Part part;
    part.what = what;
    part.lows.resize(most, 1.0);
    part.highs.resize(most, 1.0);
    part.before = part.last = false_always;
    parts_.push_back(std::move(part));
    return static_cast<int>(parts_.size()) - 1;
}

void Instants::reset()
{
    for (Part &part : parts_) {
        part.last = false_always;
    }
}

void Instants::take(std::span<const Ns> times, const double *margins, const unsigned char *unknown)
{
    times_ = times;
    margins_ = margins;
    unknown_ = unknown;
    block_++;
}

const Instants::Column &Instants::column(int number)
{
    Part &part = parts_[static_cast<std::size_t>(number)];
    if (part.block != block_) {
        part.block = block_;
        compute(part);
    }
    return part.column;
}

void Instants::compute(Part &part)
{
    const FormulaNode &what = part.what;
    double *const lows = part.lows.data(), *const highs = part.highs.data();
    switch (what.kind) {
    case FormulaNode::CONSTANT: part.column = constant(what.a != 0); return;
    case FormulaNode::CLOCK:
        if (times_.front() >= what.from || times_.back() < what.from) {
            part.column = constant(times_.front() >= what.from);
            return;
        }
        for (std::size_t k = 0; k < times_.size(); k++) {
            lows[k] = times_[k] >= what.from ? unbounded : -unbounded;
        }
        part.column = {lows, lows};
        return;
    case FormulaNode::ATOM: {
        const double *margins = margins_ + static_cast<std::size_t>(what.a) * most;
        if (!unknown_[what.a]) {
            part.column = {margins, margins};
            return;
        }
        for (std::size_t k = 0; k < times_.size(); k++) {
            lows[k] = std::isnan(margins[k]) ? -unbounded : margins[k];
            highs[k] = std::isnan(margins[k]) ? unbounded : margins[k];
        }
        part.column = {lows, highs};
        return;
    }
    default: break;
    }
    const Column a = column(what.a);
    if (what.kind == FormulaNode::NOT) {
        if (a.fixed) {
            part.column = constant(a.fixed < 0);
            return;
        }
        negative(lows, a.high, times_.size());
        if (!a.known()) {
            negative(highs, a.low, times_.size());
        }
        part.column = {lows, a.known() ? lows : highs};
    } else if (what.kind == FormulaNode::ONCE) {
        hold(part, a);
    } else if (what.kind == FormulaNode::BEGINS) {
        begin(part, a);
    } else {
        join(part, a, column(what.b));
    }
}

/// Both operands, or one of them.
void Instants::join(Part &part, const Column &a, const Column &b)
{
    const bool both = part.what.kind == FormulaNode::AND;
    const int neutral = both ? 1 : -1;
    const bool is_known = a.known() && b.known();
    if (a.fixed == neutral || b.fixed == neutral) {
        part.column = a.fixed == neutral ? b : a;
        return;
    }
    if (is_known && (a.fixed || b.fixed)) { // of what is not known, the other may be the witness
        part.column = a.fixed ? a : b;
        return;
    }
    const auto joined = both ? lesser : larger;
    joined(part.lows.data(), a.low, b.low, times_.size());
    if (!is_known) {
        joined(part.highs.data(), a.high, b.high, times_.size());
    }
    part.column = {part.lows.data(), is_known ? part.lows.data() : part.highs.data()};
}

/// The greatest value so far.
void Instants::hold(Part &part, const Column &a)
{
    part.before = part.last;
    const bool is_known = a.known() && known(part.before);
    for (const bool high : {false, true}) {
        const double *from = high ? a.high : a.low;
        double *to = high ? part.highs.data() : part.lows.data();
        double most_yet = high ? part.before.high : part.before.low;
        Witness at = high ? part.before.at_high : part.before.at_low;
        part.at[high].resize(most);
        for (std::size_t k = 0; k < times_.size(); k++) {
            if (from[k] > most_yet ||
                (from[k] == most_yet && !a.known() && !at.unknown && witness(part.what.a, k, high).unknown)) {
                most_yet = from[k];
                at = witness(part.what.a, k, high);
            }
            to[k] = most_yet;
            part.at[high][k] = at;
        }
        (high ? part.last.high : part.last.low) = most_yet;
        (high ? part.last.at_high : part.last.at_low) = at;
        if (is_known) {
            part.last.high = part.last.low, part.last.at_high = part.last.at_low;
            break;
        }
    }
    part.column = {part.lows.data(), is_known ? part.lows.data() : part.highs.data()};
}

/// The value, and not the one at the sample before; before the first one there is none.
void Instants::begin(Part &part, const Column &a)
{
    part.before = part.last;
    const bool is_known = a.known() && known(part.before);
    for (const bool high : {false, true}) {
        const double *now = high ? a.high : a.low, *other = high ? a.low : a.high;
        double *to = high ? part.highs.data() : part.lows.data();
        double not_before = -(high ? part.before.low : part.before.high);
        for (std::size_t k = 0; k < times_.size(); k++) {
            to[k] = not_before < now[k] ? not_before : now[k];
            not_before = -other[k];
        }
        if (is_known) {
            break;
        }
    }
    part.last = at(part.what.a, times_.size() - 1);
    part.column = {part.lows.data(), is_known ? part.lows.data() : part.highs.data()};
}

/// Which sample and atom decided a bound, as least() and greatest() choose it.
Witness Instants::witness(int number, std::size_t k, bool high) const
{
    const Part &part = parts_[static_cast<std::size_t>(number)];
    const int a = part.what.a, b = part.what.b;
    const auto bound = [&](int of, std::size_t i, bool upper) {
        const Column &column = parts_[static_cast<std::size_t>(of)].column;
        return upper ? column.high[i] : column.low[i];
    };
    switch (part.what.kind) {
    case FormulaNode::ATOM: return {times_[k], a, part.column.low[k] != part.column.high[k]};
    case FormulaNode::NOT: return witness(a, k, !high);
    case FormulaNode::AND:
    case FormulaNode::OR: {
        const double sign = part.what.kind == FormulaNode::AND ? 1.0 : -1.0;
        const double x = sign * bound(a, k, high), y = sign * bound(b, k, high);
        if (x != y) {
            return witness(y < x ? b : a, k, high);
        }
        const Witness first = witness(a, k, high);
        if (first.unknown || std::isfinite(x)) {
            return first;
        }
        const Witness second = witness(b, k, high);
        return second.unknown ? second : first;
    }
    case FormulaNode::ONCE: return part.at[high && !part.column.known()][k];
    case FormulaNode::BEGINS: {
        const double now = bound(a, k, high);
        const double not_before = k ? -bound(a, k - 1, !high) : -(high ? part.before.low : part.before.high);
        const auto at_before = [&] {
            return k ? witness(a, k - 1, !high) : high ? part.before.at_low : part.before.at_high;
        };
        if (now != not_before) {
            return now < not_before ? witness(a, k, high) : at_before();
        }
        const Witness first = witness(a, k, high), second = at_before();
        return second.unknown && !first.unknown ? second : first;
    }
    default: return {};
    }
}

Robustness Instants::at(int part, std::size_t k)
{
    const Column &of = column(part);
    return {of.low[k], of.high[k], witness(part, k, false), witness(part, k, true)};
}

} // namespace fledge::sim

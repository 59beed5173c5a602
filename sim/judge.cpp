// SPDX-License-Identifier: Apache-2.0
#include "sim/judge.h"

#include "sim/structure.h"

#include "flight/math/elementary.h"
#include "flight/msg/head.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace fledge::sim {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// How far a number is from the other side of a limit; never 0, so that its sign says whether the relation holds.
double distance(Judge::Relation relation, double x, double limit)
{
    constexpr double tiny = std::numeric_limits<double>::denorm_min();
    switch (relation) {
    case Judge::LESS: return x == limit ? -tiny : limit - x;
    case Judge::LESS_EQUAL: return x == limit ? tiny : limit - x;
    case Judge::GREATER: return x == limit ? -tiny : x - limit;
    case Judge::GREATER_EQUAL: return x == limit ? tiny : x - limit;
    case Judge::EQUAL: return x == limit ? unbounded : -unbounded;
    case Judge::NOT_EQUAL: return x == limit ? -unbounded : unbounded;
    }
    return unknown;
}

double scaled(double distance, double scale)
{
    const double scaled = distance / scale;
    return scaled == 0.0 ? distance : scaled;
}

} // namespace

int Judge::source(std::shared_ptr<Instance> instance, std::uint32_t offset, FledgeType type, std::size_t elements,
                  std::optional<std::uint32_t> head)
{
    Source source;
    source.instance = std::move(instance);
    source.offset = offset;
    source.type = type;
    source.elements = elements;
    source.head = head;
    return add(std::move(source));
}

int Judge::source(const Process &process, std::shared_ptr<const Event> event)
{
    Source source;
    source.process = &process;
    source.event = std::move(event);
    return add(std::move(source));
}

int Judge::source(std::size_t elements)
{
    Source source;
    source.elements = elements;
    return add(std::move(source));
}

int Judge::add(Source source)
{
    source.at = numbers_.size();
    numbers_.resize(numbers_.size() + source.elements, unknown);
    sources_.push_back(std::move(source));
    return static_cast<int>(sources_.size()) - 1;
}

int Judge::constant(std::span<const double> numbers)
{
    Expression added;
    added.operation = CONSTANT;
    added.elements = numbers.size();
    added.at = numbers_.size();
    numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
    expressions_.push_back(added);
    return static_cast<int>(expressions_.size()) - 1;
}

int Judge::expression(Operation operation, int a, int b, double number)
{
    const auto fits = [](bool good) {
        if (!good) {
            throw std::invalid_argument("the operands of an expression do not fit");
        }
    };
    Expression added;
    added.operation = operation;
    added.number = number;
    if (operation == SOURCE) {
        fits(a >= 0 && static_cast<std::size_t>(a) < sources_.size());
        added.elements = sources_[static_cast<std::size_t>(a)].elements;
        added.at = sources_[static_cast<std::size_t>(a)].at;
        expressions_.push_back(added);
        return static_cast<int>(expressions_.size()) - 1;
    }
    fits(operation != CONSTANT && a >= 0 && static_cast<std::size_t>(a) < expressions_.size());
    const Expression &first = expressions_[static_cast<std::size_t>(a)];
    const std::size_t elements = first.elements;
    added.a = first.at;
    if (operation == ELEMENT) {
        fits(b >= 0 && static_cast<std::size_t>(b) < elements);
        added.b = static_cast<std::size_t>(b);
    } else if (operation == SUM || operation == DIFFERENCE || operation == ANGLE || operation == TURNED) {
        fits(b >= 0 && static_cast<std::size_t>(b) < expressions_.size());
        const Expression &second = expressions_[static_cast<std::size_t>(b)];
        fits(second.elements == elements && (operation == SUM || operation == DIFFERENCE || elements == 3));
        added.b = second.at;
    }
    const bool each = operation == MAGNITUDE || operation == SUM || operation == DIFFERENCE || operation == SCALED ||
                      operation == TURNED;
    if (operation == NORM || operation == MAX_ABS) {
        added.b = elements; // so many are read, and one is written
    }
    added.elements = each ? elements : 1;
    added.at = numbers_.size();
    numbers_.resize(numbers_.size() + added.elements, unknown);
    expressions_.push_back(added);
    return static_cast<int>(expressions_.size()) - 1;
}

int Judge::atom(int value, Relation relation, double limit, double scale)
{
    if (value < 0 || static_cast<std::size_t>(value) >= expressions_.size() ||
        expressions_[static_cast<std::size_t>(value)].elements != 1 || !(scale > 0.0)) {
        throw std::invalid_argument("a comparison is of one number, and its scale is above 0");
    }
    atoms_.push_back({expressions_[static_cast<std::size_t>(value)].at, relation, limit, scale});
    robustness_.emplace_back();
    return static_cast<int>(atoms_.size()) - 1;
}

int Judge::formula(std::vector<FormulaNode> nodes)
{
    for (const FormulaNode &node : nodes) {
        if (node.kind == FormulaNode::ATOM && (node.a < 0 || static_cast<std::size_t>(node.a) >= atoms_.size())) {
            throw std::invalid_argument("a formula has an atom that is not there");
        }
    }
    formulas_.emplace_back(std::move(nodes));
    return static_cast<int>(formulas_.size()) - 1;
}

void Judge::read(Source &source)
{
    double *to = numbers_.data() + source.at;
    if (source.instance) {
        const std::byte *from = source.instance->memory();
        if (source.head) {
            Head head;
            std::memcpy(&head, from + *source.head, sizeof head);
            if (head.quality <= QUALITY_STALE) {
                std::fill_n(to, source.elements, unknown);
                return;
            }
        }
        from += source.offset;
        for (std::size_t i = 0; i < source.elements; i++) {
            to[i] = element_read(source.type, from + i * element_size(source.type));
        }
    } else if (source.event) {
        const std::uint64_t fired = source.process->fired(*source.event).count;
        *to = fired != source.fired ? 1.0 : 0.0;
        source.fired = fired;
    }
}

void Judge::compute(const Expression &expression)
{
    const double *a = numbers_.data() + expression.a, *b = numbers_.data() + expression.b;
    double *to = numbers_.data() + expression.at;
    switch (expression.operation) {
    case SOURCE:
    case CONSTANT: break;
    case ELEMENT: *to = a[expression.b]; break;
    case NORM: {
        double sum = 0.0;
        for (std::size_t i = 0; i < expression.b; i++) {
            sum += a[i] * a[i];
        }
        *to = std::sqrt(sum);
        break;
    }
    case MAX_ABS: {
        double most = 0.0;
        for (std::size_t i = 0; i < expression.b; i++) {
            most = std::isnan(a[i]) || std::fabs(a[i]) > most ? std::fabs(a[i]) : most;
        }
        *to = most;
        break;
    }
    case MAGNITUDE:
        for (std::size_t i = 0; i < expression.elements; i++) {
            to[i] = std::fabs(a[i]);
        }
        break;
    case SUM:
        for (std::size_t i = 0; i < expression.elements; i++) {
            to[i] = a[i] + b[i];
        }
        break;
    case DIFFERENCE:
        for (std::size_t i = 0; i < expression.elements; i++) {
            to[i] = a[i] - b[i];
        }
        break;
    case SCALED:
        for (std::size_t i = 0; i < expression.elements; i++) {
            to[i] = expression.number * a[i];
        }
        break;
    case ANGLE: {
        const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
        *to = fm_atan2(std::sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
        break;
    }
    case TURNED: { // v + (8 s x (s x v) - 4 (1 - s.s) s x v) / (1 + s.s)^2
        const double s2 = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
        const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        const double cc[3] = {a[1] * c[2] - a[2] * c[1], a[2] * c[0] - a[0] * c[2], a[0] * c[1] - a[1] * c[0]};
        const double by = 1.0 / ((1.0 + s2) * (1.0 + s2));
        for (int i = 0; i < 3; i++) {
            to[i] = b[i] + (8.0 * cc[i] - 4.0 * (1.0 - s2) * c[i]) * by;
        }
        break;
    }
    }
}

void Judge::judge(Ns t)
{
    for (const Expression &expression : expressions_) {
        compute(expression);
    }
    for (std::size_t i = 0; i < atoms_.size(); i++) {
        const Atom &atom = atoms_[i];
        const double x = numbers_[atom.at];
        const Witness at{t, static_cast<int>(i), std::isnan(x)};
        robustness_[i] = std::isnan(x)
                             ? Robustness{-unbounded, unbounded, at, at}
                             : Robustness::known(scaled(distance(atom.relation, x, atom.limit), atom.scale), at);
        if (traces) {
            traces_.push_back(x);
        }
    }
    if (traces) {
        times_.push_back(t);
    }
    last_ = t;
    for (TemporalMonitor &formula : formulas_) {
        formula.step(t, robustness_);
        stop = stop || (stops && formula.value().high < 0.0);
    }
}

void Judge::take(Ns t)
{
    for (Source &source : sources_) {
        read(source);
    }
    judge(t);
}

void Judge::rewind(Ns now)
{
    if (now < 0) {
        forget();
    } else if (now < last_) {
        went_back_ = true;
    }
    stop = false;
}

void Judge::forget()
{
    for (TemporalMonitor &formula : formulas_) {
        formula.reset();
    }
    for (Source &source : sources_) {
        source.fired = 0;
    }
    times_.clear();
    traces_.clear();
    last_ = -1;
    went_back_ = false;
}

void Judge::play(std::span<const Ns> times, const std::vector<std::span<const double>> &sources)
{
    if (sources.size() != sources_.size()) {
        throw std::invalid_argument("each source needs its samples");
    }
    for (std::size_t i = 0; i < sources.size(); i++) {
        if (sources[i].size() != times.size() * sources_[i].elements) {
            throw std::invalid_argument("a source needs a row of its elements for each sample");
        }
    }
    forget();
    for (std::size_t k = 0; k < times.size(); k++) {
        for (std::size_t i = 0; i < sources.size(); i++) {
            const std::size_t n = sources_[i].elements;
            std::copy_n(sources[i].data() + k * n, n, numbers_.data() + sources_[i].at);
        }
        judge(times[k]);
    }
}

void Judge::finish(Ns t)
{
    for (TemporalMonitor &formula : formulas_) {
        formula.finish(t);
    }
}

std::vector<double> Judge::trace(int atom) const
{
    std::vector<double> rows;
    for (std::size_t i = static_cast<std::size_t>(atom); i < traces_.size(); i += atoms_.size()) {
        rows.push_back(traces_[i]);
    }
    return rows;
}

} // namespace fledge::sim

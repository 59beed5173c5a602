// SPDX-License-Identifier: Apache-2.0
#include "sim/judge.h"

#include "sim/structure.h"
#include "sim/wide.h"

#include "flight/command/activity.h"
#include "flight/math/elementary.h"
#include "flight/msg/head.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <string_view>

namespace fledge::sim {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// As many samples as fill registers: what a row has behind those that wait does not count.
std::size_t whole_registers(std::size_t samples)
{
    return samples == 1 ? 1 : (samples + 7) / 8 * 8;
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

int Judge::source(const Recorder &recorder, const Process &process, int code, Became became)
{
    Source source;
    source.recorder = &recorder;
    source.process = &process;
    source.code = code;
    source.became = became;
    return add(std::move(source));
}

int Judge::source(Process &process, std::uint16_t stream)
{
    Source source;
    source.packet = process.telemetry.newest(stream);
    source.fired = source.packet->count;
    return add(std::move(source));
}

int Judge::source(Process &process, std::uint16_t stream, std::uint32_t offset, FledgeType type, std::size_t elements,
                  std::optional<std::uint32_t> head)
{
    Source source;
    source.packet = process.telemetry.newest(stream);
    source.offset = offset;
    source.type = type;
    source.elements = elements;
    source.head = head;
    source.fired = source.packet->count;
    source.numbers.assign(elements, unknown);
    return add(std::move(source));
}

int Judge::source(std::size_t elements)
{
    Source source;
    source.elements = elements;
    return add(std::move(source));
}

std::size_t Judge::rows(std::size_t elements)
{
    const std::size_t at = columns_.size() / Instants::most;
    columns_.resize(columns_.size() + elements * Instants::most, unknown);
    return at;
}

int Judge::add(Source source)
{
    source.at = rows(source.elements);
    sources_.push_back(std::move(source));
    return static_cast<int>(sources_.size()) - 1;
}

int Judge::constant(std::span<const double> numbers)
{
    Expression added;
    added.operation = CONSTANT;
    added.elements = numbers.size();
    added.at = rows(added.elements);
    for (std::size_t i = 0; i < numbers.size(); i++) {
        std::fill_n(row(added.at + i), Instants::most, numbers[i]);
    }
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
        added.at = first.at + static_cast<std::size_t>(b);
        expressions_.push_back(added);
        return static_cast<int>(expressions_.size()) - 1;
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
    added.at = rows(added.elements);
    expressions_.push_back(added);
    return static_cast<int>(expressions_.size()) - 1;
}

int Judge::atom(int value, Relation relation, double limit, double scale)
{
    if (value < 0 || static_cast<std::size_t>(value) >= expressions_.size() ||
        expressions_[static_cast<std::size_t>(value)].elements != 1 || !(scale > 0.0)) {
        throw std::invalid_argument("a comparison is of one number, and its scale is above 0");
    }
    expressions_[static_cast<std::size_t>(value)].compared = true;
    atoms_.push_back({static_cast<std::size_t>(value), relation, limit, scale});
    margins_.resize(margins_.size() + Instants::most, unknown);
    unknown_.push_back(0);
    return static_cast<int>(atoms_.size()) - 1;
}

int Judge::formula(const std::vector<FormulaNode> &nodes)
{
    for (const FormulaNode &node : nodes) {
        if (node.kind == FormulaNode::ATOM && (node.a < 0 || static_cast<std::size_t>(node.a) >= atoms_.size())) {
            throw std::invalid_argument("a formula has an atom that is not there");
        }
    }
    return formulas_.formula(nodes);
}

void Judge::read(Source &source)
{
    double *to = row(source.at) + count_;
    if (source.instance) {
        const std::byte *from = source.instance->memory();
        Head head;
        if (source.head) {
            std::memcpy(&head, from + *source.head, sizeof head);
        }
        from += source.offset;
        if (source.head && head.quality <= QUALITY_STALE) {
            for (std::size_t i = 0; i < source.elements; i++) {
                to[i * Instants::most] = unknown;
            }
        } else if (source.type == FLEDGE_F64) {
            for (std::size_t i = 0; i < source.elements; i++) {
                std::memcpy(to + i * Instants::most, from + i * sizeof *to, sizeof *to);
            }
        } else {
            for (std::size_t i = 0; i < source.elements; i++) {
                to[i * Instants::most] = element_read(source.type, from + i * element_size(source.type));
            }
        }
    } else if (source.event) {
        const std::uint64_t fired = source.process->fired(*source.event).count;
        *to = fired != source.fired ? 1.0 : 0.0;
        source.fired = fired;
    } else if (source.recorder) {
        *to = became(source) ? 1.0 : 0.0;
    } else if (source.packet) {
        read_packet(source, to);
    }
}

/// Whether a packet was sent since the sample before, or its numbers, which are decoded once.
void Judge::read_packet(Source &source, double *to)
{
    const bool sent = source.fired != source.packet->count;
    source.fired = source.packet->count;
    if (source.numbers.empty()) {
        *to = sent ? 1.0 : 0.0;
        return;
    }
    if (sent) {
        const std::vector<std::uint8_t> &bytes = source.packet->bytes;
        const auto number = [&](FledgeType type, std::size_t at) {
            const std::size_t width = element_size(type);
            std::array<std::uint8_t, sizeof(std::uint64_t)> native{};
            if (at + width > bytes.size()) {
                return unknown;
            }
            std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), width, native.begin());
            if (std::endian::native == std::endian::little) {
                std::reverse(native.begin(), native.begin() + width);
            }
            return element_read(type, native.data());
        };
        const bool good = !source.head || number(FLEDGE_ENUM, *source.head + offsetof(Head, quality)) >
                                              static_cast<double>(QUALITY_STALE);
        for (std::size_t i = 0; i < source.elements; i++) {
            source.numbers[i] = good ? number(source.type, source.offset + i * element_size(source.type)) : unknown;
        }
    }
    for (std::size_t i = 0; i < source.elements; i++) {
        to[i * Instants::most] = source.numbers[i];
    }
}

/// Whether a command has become so since the sample before. The executive's log has all that happened in the process.
bool Judge::became(Source &source) const
{
    if (!source.log) {
        const auto instance = source.process->executive().instance();
        for (const auto &log : source.recorder->followed()) {
            if (log->instance == instance && std::string_view(log->field->name) == "activity") {
                source.log = log;
            }
        }
        if (!source.log) {
            return false;
        }
    }
    bool found = false;
    for (; source.fired < source.log->times.size(); source.fired++) {
        Activity activity;
        std::memcpy(&activity, source.log->bytes.data() + source.fired * sizeof activity, sizeof activity);
        const bool executed = activity.kind == ACTIVITY_EXECUTED, good = activity.reason == COMMAND_OK;
        found = found || ((executed || activity.kind == ACTIVITY_ACCEPTED) &&
                          (source.code < 0 || static_cast<int>(activity.code) == source.code) &&
                          (source.became == REFUSED ? !good : good && executed == (source.became == EXECUTED)));
    }
    return found;
}

/// Compute an expression in each sample that waits.
[[gnu::always_inline]] inline void Judge::compute(Expression &expression)
{
    constexpr std::size_t width = Instants::most;
    const std::size_t n = whole_registers(count_);
    const double *a = row(expression.a), *b = row(expression.b);
    double *to = row(expression.at);
    const double number = expression.number;
    switch (expression.operation) {
    case SOURCE:
    case CONSTANT:
    case ELEMENT: break;
    case NORM:
        std::fill_n(to, n, 0.0);
        for (std::size_t i = 0; i < expression.b; i++, a += width) {
            for (std::size_t k = 0; k < n; k++) {
                to[k] += a[k] * a[k];
            }
        }
        for (std::size_t k = 0; k < n; k++) {
            to[k] = std::sqrt(to[k]);
        }
        break;
    case MAX_ABS:
        std::fill_n(to, n, 0.0);
        for (std::size_t i = 0; i < expression.b; i++, a += width) {
            for (std::size_t k = 0; k < n; k++) {
                const double x = std::fabs(a[k]), most = x > to[k] ? x : to[k];
                to[k] = x == x ? most : x; // what is unknown stays so
            }
        }
        break;
    case MAGNITUDE:
        for (std::size_t i = 0; i < expression.elements; i++, a += width, b += width, to += width) {
            for (std::size_t k = 0; k < n; k++) {
                to[k] = std::fabs(a[k]);
            }
        }
        break;
    case SUM:
        for (std::size_t i = 0; i < expression.elements; i++, a += width, b += width, to += width) {
            for (std::size_t k = 0; k < n; k++) {
                to[k] = a[k] + b[k];
            }
        }
        break;
    case DIFFERENCE:
        for (std::size_t i = 0; i < expression.elements; i++, a += width, b += width, to += width) {
            for (std::size_t k = 0; k < n; k++) {
                to[k] = a[k] - b[k];
            }
        }
        break;
    case SCALED:
        for (std::size_t i = 0; i < expression.elements; i++, a += width, b += width, to += width) {
            for (std::size_t k = 0; k < n; k++) {
                to[k] = number * a[k];
            }
        }
        break;
    case ANGLE:
        for (std::size_t k = 0; k < count_; k++) {
            const double u[3] = {a[k], a[width + k], a[2 * width + k]}, v[3] = {b[k], b[width + k], b[2 * width + k]};
            const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
            to[k] = fm_atan2(std::sqrt(x * x + y * y + z * z), u[0] * v[0] + u[1] * v[1] + u[2] * v[2]);
        }
        break;
    case TURNED: // v + (8 s x (s x v) - 4 (1 - s.s) s x v) / (1 + s.s)^2
        for (std::size_t k = 0; k < count_; k++) {
            const double s[3] = {a[k], a[width + k], a[2 * width + k]}, v[3] = {b[k], b[width + k], b[2 * width + k]};
            const double s2 = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
            const double c[3] = {s[1] * v[2] - s[2] * v[1], s[2] * v[0] - s[0] * v[2], s[0] * v[1] - s[1] * v[0]};
            const double cc[3] = {s[1] * c[2] - s[2] * c[1], s[2] * c[0] - s[0] * c[2], s[0] * c[1] - s[1] * c[0]};
            const double by = 1.0 / ((1.0 + s2) * (1.0 + s2));
            for (std::size_t i = 0; i < 3; i++) {
                to[i * width + k] = v[i] + (8.0 * cc[i] - 4.0 * (1.0 - s2) * c[i]) * by;
            }
        }
        break;
    }
    if (expression.compared) {
        expression.unknown = 0;
        const double *x = row(expression.at);
        for (std::size_t k = 0; k < count_; k++) {
            expression.unknown |= x[k] != x[k];
        }
    }
}

/// How far the numbers are from the other side of the limit; never 0, so that the sign says whether the relation holds.
[[gnu::always_inline]] inline void Judge::compare(const Atom &atom, double *to)
{
    constexpr double tiny = std::numeric_limits<double>::denorm_min();
    const std::size_t n = whole_registers(count_);
    const double *x = row(expressions_[atom.expression].at), limit = atom.limit, scale = atom.scale;
    const bool below = atom.relation == LESS || atom.relation == LESS_EQUAL;
    if (atom.relation == EQUAL || atom.relation == NOT_EQUAL) {
        const double equal = atom.relation == EQUAL ? unbounded : -unbounded;
        for (std::size_t k = 0; k < n; k++) {
            const double found = x[k] == limit ? equal : -equal;
            to[k] = x[k] == x[k] ? found : unknown;
        }
        return;
    }
    const double sign = below ? 1.0 : -1.0;
    const double on_the_limit = atom.relation == LESS || atom.relation == GREATER ? -tiny : tiny;
    for (std::size_t k = 0; k < n; k++) {
        to[k] = sign * (limit - x[k]);
    }
    for (std::size_t k = 0; k < n; k++) {
        to[k] = to[k] == 0.0 ? on_the_limit : to[k];
    }
    if (scale != 1.0) {
        for (std::size_t k = 0; k < n; k++) {
            const double scaled = to[k] / scale;
            to[k] = scaled == 0.0 ? to[k] : scaled;
        }
    }
}

[[gnu::always_inline]] inline void Judge::compute_all()
{
    for (Expression &expression : expressions_) {
        compute(expression);
    }
    for (std::size_t i = 0; i < atoms_.size(); i++) {
        compare(atoms_[i], margins_.data() + i * Instants::most);
        unknown_[i] = expressions_[atoms_[i].expression].unknown != 0;
    }
}

/// The samples that wait.
void Judge::judge()
{
    if (count_ == 0) {
        return;
    }
    in_registers<&Judge::compute_all>(*this);
    if (traces) {
        for (std::size_t k = 0; k < count_; k++) {
            for (const Atom &atom : atoms_) {
                traces_.push_back(row(expressions_[atom.expression].at)[k]);
            }
        }
        times_.insert(times_.end(), waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count_));
    }
    formulas_.take({waiting_.data(), count_}, margins_.data(), unknown_.data());
    count_ = 0;
}

void Judge::take(Ns t)
{
    for (Source &source : sources_) {
        read(source);
    }
    waiting_[count_++] = last_ = t;
    if (stops || count_ == Instants::most) {
        judge();
        stop = stop || (stops && formulas_.violated());
    }
}

/// A rule that ends the run does so at the end of an instant. Events and packets become known there, too.
bool Judge::is_early(const std::function<bool(const Instance &)> &waits) const
{
    return !stops && std::ranges::all_of(
                         sources_, [&](const Source &source) { return source.instance && !waits(*source.instance); });
}

void Judge::rewind(Ns now)
{
    for (Source &source : sources_) {
        source.fired = source.packet ? source.packet->count : source.fired;
        std::fill(source.numbers.begin(), source.numbers.end(), unknown); // of a packet of another time
    }
    if (now < 0) {
        forget();
    } else if (now < last_) {
        went_back_ = true;
        for (Source &source : sources_) { // the recorder has dropped what came later
            source.fired = source.log ? std::min<std::uint64_t>(source.fired, source.log->times.size()) : source.fired;
        }
    }
    stop = false;
}

void Judge::forget()
{
    formulas_.reset();
    for (Source &source : sources_) {
        source.fired = source.packet ? source.packet->count : 0;
        source.log = nullptr;
    }
    count_ = 0;
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
            for (std::size_t j = 0; j < n; j++) {
                row(sources_[i].at + j)[count_] = sources[i][k * n + j];
            }
        }
        waiting_[count_++] = last_ = times[k];
        if (count_ == Instants::most) {
            judge();
        }
    }
}

void Judge::finish(Ns t)
{
    judge();
    formulas_.finish(t);
}

Robustness Judge::value(int formula)
{
    judge();
    return formulas_.value(formula);
}

const std::vector<Ns> &Judge::times()
{
    judge();
    return times_;
}

std::vector<double> Judge::trace(int atom)
{
    judge();
    std::vector<double> found;
    for (std::size_t i = static_cast<std::size_t>(atom); i < traces_.size(); i += atoms_.size()) {
        found.push_back(traces_[i]);
    }
    return found;
}

} // namespace fledge::sim

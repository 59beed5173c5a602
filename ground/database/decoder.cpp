// SPDX-License-Identifier: Apache-2.0
#include "ground/database/decoder.h"

#include <algorithm>
#include <cmath>

namespace fledge::ground {

namespace {

constexpr std::size_t most_fields = 1 << 20;   // of a packet
constexpr std::size_t most_planned = 1 << 22;  // of all plans
constexpr std::size_t most_effort = 1 << 23;   // entries and 8-byte words that a packet may take
constexpr std::size_t most_bytes = 1 << 26;    // of a packet and its texts
constexpr std::size_t most_laid = 1 << 25;     // entries and values of all plans, also of those that are given up
constexpr std::size_t most_compared = 1 << 27; // fields that the comparisons of a plan's heirs look at
constexpr std::size_t most_held = 256;         // members and elements of a parameter that something refers to
constexpr std::size_t most_said = 1000;        // characters of what was not fulfilled
constexpr std::size_t padding = 16;            // so that every word can be read

using Sort = Type::Sort;
using std::bit_cast;

std::uint64_t word(double x)
{
    return bit_cast<std::uint64_t>(x);
}

std::size_t comparisons(const Condition &condition)
{
    std::size_t n = 1;
    for (const Condition &part : condition.parts) {
        n += comparisons(part);
    }
    return n;
}

} // namespace

/// The enumerators of a type: a table from the lowest value on if it is short, and all in their order.
struct Decoder::Labels {
    std::int64_t low = 0;
    std::vector<std::uint32_t> table;
    std::vector<std::pair<std::int64_t, std::uint32_t>> sorted; ///< low end, place
};

/// The value of an earlier packet.
struct Decoder::Held {
    Reference reference;
    bool there = false;
    Field field{};
    std::uint64_t raw = 0, value = 0;
    Status status = Status::good;
    std::string text; ///< of a text or binary value
};

struct Decoder::Operand {
    Kind kind;
    std::uint64_t word;
    const Type *type;
    std::uint64_t raw = 0; ///< of a label
    std::string_view text{};
    std::optional<std::size_t> at{}; ///< [bits] in this packet
};

struct Decoder::Walk {
    std::size_t at;                     ///< [bits]
    std::size_t start;                  ///< [bits] of the container
    bool included = false;              ///< in another container
    bool back = false;                  ///< `at` is behind an entry that is placed from the packet's end
    std::size_t front = 0;              ///< [bits] then: where those of heirs go on
    std::size_t most = 0;               ///< [bits] behind the furthest of the others
    std::size_t tail = ~std::size_t(0); ///< [bits] of the first of those that are placed from the end
    std::size_t end = 0;                ///< [bits] behind the furthest of them
};

/// What a container with fixed places needs, in loops.
struct Decoder::Plan {
    enum class Load : std::uint8_t { u8, u16, u32, u64, i8, i16, i32, f32, f64, bits, other };
    enum class Make : std::uint8_t { same, from_natural, from_integer, line, other };
    struct Step {
        Load load;
        Make make;
        std::uint32_t first, n; ///< fields
        std::uint32_t bits;     ///< of each
        std::size_t at;         ///< [bits] of the first
        const Type *type;       ///< of each, or of the one
    };
    /// The restriction of heirs by one value: those that may fit each value, and those that do not ask for it.
    struct Dispatch {
        std::size_t at = 0;
        const Encoding *encoding = nullptr; ///< nullptr: there is none
        std::unordered_map<std::uint64_t, std::vector<Id>> heirs;
        std::vector<Id> others;
    };
    bool fixed = false;
    bool searches = false;         ///< for heirs, entry by entry
    std::size_t end = 0, most = 0; ///< [bits] behind the last entry, and behind the furthest
    std::vector<Field> fields;
    std::vector<std::size_t> places; ///< [bits] of each field
    std::vector<PathNode> nodes{{0, 0, no_id}};
    std::vector<Step> steps;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> held; ///< field, slot
    Dispatch dispatch;
};

Decoder::Decoder(const Database &database, bool plans)
    : db_(database), plans_on_(plans), plans_(database.containers.size()), labels_(database.types.size())
{
    std::vector<bool> contained(db_.containers.size());
    for (const Container &one : db_.containers) {
        for (const Entry &entry : one.entries) {
            if (entry.what == Entry::What::container) {
                contained[entry.id] = true;
            }
            hold(entry.offset), hold(entry.count), hold(entry.gap), hold(entry.include), hold(entry.selector);
            for (const Dimension &dimension : entry.dimensions) {
                hold(dimension.first), hold(dimension.last);
            }
        }
    }
    for (const Command &command : db_.commands) {
        for (const Verifier &one : command.verifiers) {
            hold(one.condition), hold(one.changes), hold(one.returns);
        }
    }
    for (const bool extended : {true, false}) {
        for (Id i = 0; i < db_.containers.size(); i++) {
            const Container &one = db_.containers[i];
            if (one.base == no_id && !one.of_command && (extended ? !one.heirs.empty() : !contained[i])) {
                roots_.push_back(i);
            }
        }
        if (!roots_.empty()) {
            break;
        }
    }
    for (Id i = 0; i < db_.types.size(); i++) {
        const Type &type = db_.types[i];
        hold(type.offset_from), hold(type.encoding.size);
        for (const Dimension &dimension : type.dimensions) {
            hold(dimension.first), hold(dimension.last);
        }
        for (const MathStep &step : type.encoding.calibrator.steps) {
            hold(step.value);
        }
        for (const Alarm &alarm : type.alarms) {
            hold(alarm.when);
        }
        for (const auto &[condition, calibrator] : type.encoding.contexts) {
            hold(condition);
            for (const MathStep &step : calibrator.steps) {
                hold(step.value);
            }
        }
        if (!type.enumerators.empty()) {
            labels_[i] = std::make_unique<Labels>();
            Labels &made = *labels_[i];
            for (std::uint32_t j = 0; j < type.enumerators.size(); j++) {
                made.sorted.emplace_back(type.enumerators[j].low, j);
            }
            std::sort(made.sorted.begin(), made.sorted.end());
            made.low = made.sorted.front().first;
            const Wide span = Wide(type.enumerators[made.sorted.back().second].high) - made.low;
            if (span < 1024) {
                made.table.assign(static_cast<std::size_t>(span) + 1, no_id);
                for (const auto &[low, place] : made.sorted) {
                    for (std::int64_t value = low; value <= type.enumerators[place].high; value++) {
                        made.table[static_cast<std::size_t>(value - made.low)] = place;
                    }
                }
            }
        }
    }
}

Decoder::~Decoder() = default;

// --- values of earlier packets

void Decoder::hold(const Reference &reference)
{
    if (reference.of != Reference::Of::parameter) {
        return;
    }
    auto &slots = slots_[reference.parameter];
    for (const std::uint32_t slot : slots) {
        if (held_[slot].reference.steps == reference.steps) {
            return;
        }
    }
    if (slots.size() == most_held) {
        throw Refusal(db_.where(db_.parameters[reference.parameter].place) + ": more than " +
                      std::to_string(most_held) + " members and elements of " +
                      db_.parameters[reference.parameter].path + " are referred to");
    }
    slots.push_back(static_cast<std::uint32_t>(held_.size()));
    held_.emplace_back().reference = reference;
}

void Decoder::hold(const Condition &condition)
{
    hold(condition.left), hold(condition.right);
    for (const Condition &part : condition.parts) {
        hold(part);
    }
}

void Decoder::hold(const Quantity &quantity)
{
    hold(quantity.from);
    for (const auto &[condition, value] : quantity.cases) {
        hold(condition);
    }
}

void Decoder::remember(const Decoder &other)
{
    held_ = other.held_;
}

void Decoder::keep(std::size_t field, std::uint32_t slot)
{
    Held &held = held_[slot];
    held.there = true;
    held.field = packet_.fields[field];
    held.raw = raw_[field];
    held.value = values_[field];
    held.status = status_[field];
    if (held.field.raw == Kind::text || held.field.raw == Kind::binary) {
        held.text = text_of(held.field.value == Kind::text ? held.value : held.raw);
    }
}

/// Whether the steps of a reference lead to a node.
bool Decoder::leads(const Reference &reference, std::span<const PathNode> nodes, std::uint32_t node) const
{
    for (std::size_t i = reference.steps.size(); i-- > 0; node = nodes[node].parent) {
        if (node == 0 || nodes[node].place != reference.steps[i]) {
            return false;
        }
    }
    return node == 0;
}

std::optional<Decoder::Operand> Decoder::find(const Reference &reference, bool earlier)
{
    const auto operand = [&](const Field &field, std::uint64_t raw, std::uint64_t value, Status status,
                             std::string_view text) -> std::optional<Operand> {
        const bool calibrated = reference.calibrated && field.value != Kind::none;
        if (status == Status::malformed || (calibrated && status == Status::uncalibrated)) {
            return std::nullopt;
        }
        return Operand{calibrated ? field.value : field.raw, calibrated ? value : raw, &db_.types[field.type], raw,
                       text};
    };
    const bool named = reference.of == Reference::Of::argument; // or a member beside the one that refers
    for (std::size_t i = fields_.size(); i-- > 0;) {
        const Field &field = fields_[i];
        const PathNode &node = nodes_[field.node];
        if (named ? (field.node != 0
                         ? db_.types[node.type].sort == Sort::aggregate &&
                               db_.types[node.type].members[node.place].name == reference.name
                         : field.parameter >= db_.arguments && db_.parameters[field.parameter].name == reference.name)
                  : field.parameter == reference.parameter && leads(reference, nodes_, field.node)) {
            const bool text = field.raw == Kind::text || field.raw == Kind::binary;
            auto found =
                operand(field, raw_[i], values_[i], status_[i],
                        text ? text_of(field.value == Kind::text && reference.calibrated ? values_[i] : raw_[i])
                             : std::string_view());
            if (found && !plans_on_) {
                found->at = places_[i].at;
            }
            return found;
        }
    }
    if (named || !earlier) {
        return std::nullopt;
    }
    for (const std::uint32_t slot : slots_[reference.parameter]) {
        const Held &held = held_[slot];
        if (held.there && held.reference.steps == reference.steps) {
            return operand(held.field, held.raw, held.value, held.status, held.text);
        }
    }
    const Parameter &parameter = db_.parameters[reference.parameter];
    const Type &type = db_.types[parameter.type];
    const auto &initial = parameter.initial ? parameter.initial : type.initial;
    if (!initial || !reference.steps.empty()) {
        return std::nullopt;
    }
    for (std::uint32_t i = 0; i < type.enumerators.size(); i++) {
        if (type.enumerators[i].label == *initial) {
            return Operand{Kind::label, i, &type, static_cast<std::uint64_t>(type.enumerators[i].low)};
        }
    }
    if (type.sort == Sort::boolean) {
        return Operand{Kind::boolean, *initial == type.one || *initial == "true" || *initial == "1", &type};
    }
    char *end = nullptr;
    const double number = std::strtod(initial->c_str(), &end);
    if (type.sort != Sort::text && end != initial->c_str() && *end == '\0') {
        return Operand{Kind::real, word(number), &type};
    }
    return Operand{Kind::text, 0, &type, 0, *initial};
}

std::string_view Decoder::text_of(std::uint64_t slice) const
{
    return {reinterpret_cast<const char *>(bytes_.data()) + (slice >> 32), slice & 0xFFFFFFFF};
}

std::optional<std::int64_t> Decoder::number(const Quantity &quantity)
{
    if (quantity.looked_up) {
        for (const auto &[condition, value] : quantity.cases) {
            if (holds(condition, true)) {
                return value;
            }
        }
        return std::nullopt;
    }
    if (quantity.is_fixed()) {
        return quantity.fixed;
    }
    const auto found = find(quantity.from, true);
    auto value = found ? real_of(found->kind, found->word) : std::nullopt;
    if (found && found->kind == Kind::label) {
        value = static_cast<double>(static_cast<std::int64_t>(found->raw));
    }
    if (!value || !(std::abs(*value * quantity.slope + quantity.intercept) < 1e15)) {
        return std::nullopt;
    }
    return nearest(*value * quantity.slope + quantity.intercept);
}

/// A size [bits] of what begins at a bit.
std::optional<std::int64_t> Decoder::size_at(const Quantity &quantity, std::size_t at)
{
    return quantity.from.of == Reference::Of::rest
               ? static_cast<std::int64_t>(n_bits_ - at) + static_cast<std::int64_t>(quantity.intercept)
               : number(quantity);
}

// --- conditions

namespace {

template <class Value> bool ordered(Operator op, const Value &a, const Value &b)
{
    switch (op) {
    case Operator::equal: return a == b;
    case Operator::unequal: return a != b;
    case Operator::less: return a < b;
    case Operator::at_most: return a <= b;
    case Operator::more: return a > b;
    case Operator::at_least: return a >= b;
    }
    return false;
}

Wide wide(const Literal &literal)
{
    return literal.text.find('-') != std::string::npos ? Wide(*literal.integer)
                                                       : Wide(static_cast<std::uint64_t>(*literal.integer));
}

bool is_whole(Kind kind)
{
    return kind == Kind::natural || kind == Kind::integer || kind == Kind::boolean || kind == Kind::time;
}

Wide wide(Kind kind, std::uint64_t word)
{
    return kind == Kind::natural ? Wide(word) : Wide(static_cast<std::int64_t>(word));
}

} // namespace

bool Decoder::compare(Operator op, const Operand &left, const Literal &literal) const
{
    const Type &type = *left.type;
    if (left.kind == Kind::text) {
        return ordered(op, left.text, std::string_view(literal.text));
    }
    if (left.kind == Kind::label) {
        const bool labelled = left.word != no_id;
        const bool known = std::any_of(type.enumerators.begin(), type.enumerators.end(),
                                       [&](const Enumerator &one) { return one.label == literal.text; });
        if (known || !literal.integer) {
            return ordered(op, std::string_view(labelled ? type.enumerators[left.word].label.c_str() : ""),
                           std::string_view(literal.text));
        }
        return ordered(op, Wide(static_cast<std::int64_t>(left.raw)), wide(literal));
    }
    if (left.kind == Kind::boolean && !literal.integer) {
        const bool one = literal.text == type.one || literal.text == "true" || literal.text == "True";
        const bool zero = literal.text == type.zero || literal.text == "false" || literal.text == "False";
        return (one || zero) && ordered(op, left.word != 0, one);
    }
    if (is_whole(left.kind) && literal.integer) {
        return ordered(op, wide(left.kind, left.word), wide(literal));
    }
    const auto value = real_of(left.kind, left.word);
    return value && literal.real && ordered(op, *value, *literal.real);
}

bool Decoder::compare(Operator op, const Operand &left, const Operand &right) const
{
    if (left.kind == Kind::text || right.kind == Kind::text || left.kind == Kind::label || right.kind == Kind::label) {
        const auto text = [](const Operand &one) -> std::string_view {
            if (one.kind != Kind::label) {
                return one.text;
            }
            return one.word == no_id ? std::string_view() : std::string_view(one.type->enumerators[one.word].label);
        };
        return (left.kind == Kind::text || left.kind == Kind::label) &&
               (right.kind == Kind::text || right.kind == Kind::label) && ordered(op, text(left), text(right));
    }
    if (is_whole(left.kind) && is_whole(right.kind)) {
        return ordered(op, wide(left.kind, left.word), wide(right.kind, right.word));
    }
    const auto a = real_of(left.kind, left.word), b = real_of(right.kind, right.word);
    return a && b && ordered(op, *a, *b);
}

bool Decoder::holds(const Condition &condition, bool earlier)
{
    if (effort_ > most_effort) {
        return false; // and the next entry says so
    }
    switch (condition.what) {
    case Condition::What::always: return true;
    case Condition::What::all:
        return std::all_of(condition.parts.begin(), condition.parts.end(),
                           [&](auto &one) { return holds(one, earlier); });
    case Condition::What::any:
        return std::any_of(condition.parts.begin(), condition.parts.end(),
                           [&](auto &one) { return holds(one, earlier); });
    case Condition::What::compare: break;
    }
    effort_ += 1 + fields_.size() / 16;
    const auto left = find(condition.left, earlier);
    if (!left || condition.right.of == Reference::Of::nothing) {
        return left && compare(condition.op, *left, condition.literal);
    }
    const auto right = find(condition.right, earlier);
    return right && compare(condition.op, *left, *right);
}

// --- from raw to calibrated values

Kind value_kind(const Type &type)
{
    const Kind raw = raw_kind(type.encoding);
    const bool calibrates = type.encoding.calibrator.what != Calibrator::What::none || !type.encoding.contexts.empty();
    if (!type.encoding.algorithm.empty() || raw == Kind::none) {
        return Kind::none;
    }
    switch (type.sort) {
    case Sort::integer: return calibrates || raw == Kind::real || raw == Kind::text ? Kind::integer : raw;
    case Sort::real: return Kind::real;
    case Sort::enumerated: return Kind::label;
    case Sort::boolean: return Kind::boolean;
    case Sort::text: return raw == Kind::text || raw == Kind::binary ? Kind::text : raw;
    case Sort::binary: return raw == Kind::text || raw == Kind::binary ? Kind::binary : raw;
    case Sort::absolute_time:
    case Sort::relative_time: return Kind::time;
    default: return Kind::none;
    }
}

bool Decoder::refers(const Type &type) const
{
    return !type.encoding.contexts.empty() || type.encoding.calibrator.refers ||
           type.offset_from.of != Reference::Of::nothing;
}

std::uint64_t Decoder::label(const Type &type, std::int64_t raw) const
{
    if (type.enumerators.empty()) {
        return no_id;
    }
    const Labels &known = labels(static_cast<Id>(&type - db_.types.data()));
    if (!known.table.empty()) {
        const auto place = static_cast<std::uint64_t>(raw) - static_cast<std::uint64_t>(known.low);
        return place < known.table.size() ? known.table[place] : no_id;
    }
    const auto above = std::upper_bound(known.sorted.begin(), known.sorted.end(), std::pair(raw, no_id));
    if (above == known.sorted.begin()) {
        return no_id;
    }
    const std::uint32_t place = std::prev(above)->second;
    return type.enumerators[place].high >= raw ? place : no_id;
}

Status Decoder::convert(const Type &type, Kind kind, std::uint64_t raw, std::uint64_t &value)
{
    const Encoding &encoding = type.encoding;
    const Calibrator *calibrator = encoding.calibrator.what != Calibrator::What::none ? &encoding.calibrator : nullptr;
    for (const auto &[condition, other] : encoding.contexts) {
        if (holds(condition, true)) {
            calibrator = &other;
            break;
        }
    }
    value = 0;
    if (kind == Kind::text) { // the slice is UTF-8
        const std::string text(text_of(raw));
        char *end = nullptr;
        errno = 0;
        switch (type.sort) {
        case Sort::integer:
            value = static_cast<std::uint64_t>(std::strtoll(text.c_str(), &end, 10));
            return end != text.c_str() && *end == '\0' && errno == 0 ? Status::good : Status::malformed;
        case Sort::real:
        case Sort::absolute_time:
        case Sort::relative_time: kind = Kind::real, raw = word(std::strtod(text.c_str(), &end)); break;
        case Sort::enumerated:
            for (value = 0; value < type.enumerators.size(); value++) {
                if (type.enumerators[value].label == text) {
                    return Status::good;
                }
            }
            value = no_id;
            return Status::unlabelled;
        case Sort::boolean:
            value = text == type.one;
            return value || text == type.zero ? Status::good : Status::malformed;
        default: value = raw; return Status::good;
        }
        if (end == text.c_str() || *end != '\0') {
            value = word(std::nan(""));
            return Status::malformed;
        }
    }
    if (kind == Kind::binary) {
        value = raw;
        return Status::good;
    }
    if (calibrator != nullptr) {
        const auto made = calibrated(*calibrator, *real_of(kind, raw), [&](const Reference &reference) {
            const auto found = find(reference, true);
            return found ? real_of(found->kind, found->word) : std::nullopt;
        });
        if (!made) {
            value = type.sort == Sort::real ? word(std::nan("")) : type.sort == Sort::enumerated ? no_id : 0;
            return Status::uncalibrated;
        }
        kind = Kind::real;
        raw = word(*made);
    }
    switch (type.sort) {
    case Sort::integer:
        value = kind == Kind::real ? static_cast<std::uint64_t>(nearest(bit_cast<double>(raw))) : raw;
        break;
    case Sort::real: value = word(*real_of(kind, raw)); break;
    case Sort::boolean: value = kind == Kind::real ? bit_cast<double>(raw) != 0 : raw != 0; break;
    case Sort::enumerated:
        value = label(type, kind == Kind::real ? nearest(bit_cast<double>(raw)) : static_cast<std::int64_t>(raw));
        return value == no_id ? Status::unlabelled : Status::good;
    case Sort::absolute_time:
    case Sort::relative_time: {
        std::int64_t before = 0;
        if (type.offset_from.of != Reference::Of::nothing) {
            const auto found = find(type.offset_from, true);
            const auto seconds = found ? real_of(found->kind, found->word) : std::nullopt;
            if (!seconds) {
                return Status::uncalibrated;
            }
            before = found->kind == Kind::time ? static_cast<std::int64_t>(found->word) : nearest(*seconds * 1e9);
        }
        Wide sum = before; // exact, where a count of nanoseconds is
        constexpr double exact = 9007199254740992.0;
        if (kind != Kind::real && type.scale == std::trunc(type.scale) && type.offset == std::trunc(type.offset) &&
            std::abs(type.scale) < exact && std::abs(type.offset) < exact) {
            sum += wide(kind, raw) * static_cast<std::int64_t>(type.scale) + static_cast<std::int64_t>(type.offset);
        } else {
            const double ns = *real_of(kind, raw) * type.scale + type.offset;
            if (!(std::abs(ns) < 9e18)) {
                return Status::uncalibrated;
            }
            sum += nearest(ns);
        }
        if (sum != static_cast<std::int64_t>(sum)) {
            return Status::uncalibrated;
        }
        value = static_cast<std::uint64_t>(sum);
        break;
    }
    default: value = raw;
    }
    return Status::good;
}

// --- entry by entry

bool Decoder::broken(std::string reason)
{
    if (!broken_) {
        packet_.reason = std::move(reason);
        broken_ = true;
    }
    return false;
}

bool Decoder::spend(std::size_t effort)
{
    effort_ += effort;
    return effort_ <= most_effort && fields_.size() < most_fields && used_ < most_bytes
               ? true
               : broken("the packet has more values or repetitions than a decoder takes");
}

/// Bits that begin within a byte, to whole bytes behind the packet; the last one ends a byte.
std::uint64_t Decoder::copy(std::size_t bit, std::size_t bits)
{
    const std::size_t n = (bits + 7) / 8, to = used_;
    bytes_.resize(std::max(bytes_.size(), used_ + n + padding));
    used_ += n;
    for (std::size_t i = 0, first = bits - 8 * (n - (n > 0)); i < n; i++) {
        const std::size_t from = i == 0 ? bit : bit + first + 8 * (i - 1);
        bytes_[to + i] =
            static_cast<std::uint8_t>(load_bits(bytes_.data(), from, i == 0 ? static_cast<unsigned>(first) : 8));
    }
    return slice(to, n);
}

bool Decoder::take_binary(const Type &type, Walk &walk, std::uint64_t &raw)
{
    const auto bits = size_at(type.encoding.size, walk.at);
    if (!bits || *bits < 0 || walk.at + static_cast<std::size_t>(*bits) > n_bits_) {
        return broken(
            !type.encoding.algorithm.empty() && bits && *bits < 0
                ? type.name + " is encoded by the algorithm " + type.encoding.algorithm + ", which is not computed"
            : !bits || *bits < 0
                ? "the size of " + type.name + " is not known"
                : "the packet ends within " + type.name + ", a binary value of " + std::to_string(*bits) + " bits");
    }
    const auto n = static_cast<std::size_t>(*bits);
    raw = walk.at % 8 == 0 && n % 8 == 0 ? slice(walk.at / 8, n / 8) : copy(walk.at, n);
    walk.at += n;
    return spend(n / 64);
}

bool Decoder::take_text(const Type &type, Walk &walk, std::uint64_t &raw, std::uint64_t &value, Status &status)
{
    const Encoding &encoding = type.encoding;
    std::size_t room = n_bits_ - walk.at, tag = 0, content = 0, behind = 0;
    if (encoding.sized) {
        const auto bits = size_at(encoding.size, walk.at);
        if (!bits || *bits < 0 || static_cast<std::size_t>(*bits) > room) {
            return broken(!bits || *bits < 0 ? "the size of " + type.name + " is not known"
                                             : "the packet ends within " + type.name + ", a text of " +
                                                   std::to_string(*bits) + " bits");
        }
        room = static_cast<std::size_t>(*bits);
    }
    const std::size_t most = encoding.most_bits != 0 ? std::min<std::size_t>(encoding.most_bits, room) : room;
    if (encoding.sized && most < room) {
        status = Status::malformed;
    }
    const std::size_t unit = 8 * unit_of(encoding.charset);
    if (encoding.size_tag != 0) {
        tag = encoding.size_tag;
        if (tag > most) {
            return broken("the packet ends within the size of " + type.name);
        }
        content = 8 * load_bits(bytes_.data(), walk.at, static_cast<unsigned>(tag));
        if (content > most - tag) {
            if (!encoding.sized) {
                return broken(type.name + " has a size of " + std::to_string(content / 8) +
                              " bytes; there is room for " + std::to_string((most - tag) / 8));
            }
            status = Status::malformed;
            content = (most - tag) / 8 * 8;
        }
    } else {
        content = most / unit * unit;
        const std::size_t end = 8 * encoding.terminator.size();
        for (std::size_t i = 0; end != 0 && i + end <= most; i += unit) {
            std::size_t same = 0;
            while (same < end / 8 && load_bits(bytes_.data(), walk.at + i + 8 * same, 8) == encoding.terminator[same]) {
                same++;
            }
            if (same == end / 8) {
                content = i;
                behind = end;
                break;
            }
        }
        if (!encoding.sized && behind == 0) {
            return broken("no " + std::to_string(encoding.terminator.size()) + "-byte character ends " + type.name);
        }
    }
    const std::size_t from = walk.at + tag;
    raw = from % 8 == 0 ? slice(from / 8, content / 8) : copy(from, content);
    value = raw;
    if (encoding.charset != Charset::utf8) {
        const auto text = utf8(encoding.charset, {bytes_.data() + (raw >> 32), raw & 0xFFFFFFFF});
        bytes_.resize(std::max(bytes_.size(), used_ + text.size() + padding));
        std::copy(text.begin(), text.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(used_));
        value = slice(used_, text.size());
        used_ += text.size();
    }
    walk.at += encoding.sized ? room : tag + content + behind;
    return spend(content / 16);
}

/// How many elements an array has; beyond 2^20, some number beyond.
std::optional<std::size_t> Decoder::elements(const std::vector<Dimension> &dimensions)
{
    std::size_t n = 1;
    for (const Dimension &one : dimensions) {
        const auto first = number(one.first), last = number(one.last);
        if (!first || !last || *last - *first < -1 || *last - *first >= std::int64_t(most_fields)) {
            return std::nullopt;
        }
        n = std::min((most_fields + 1), n * static_cast<std::size_t>(*last - *first + 1));
    }
    return n;
}

/// [bits] of a type, if they are known before it is decoded.
std::optional<std::int64_t> Decoder::size(Id id, const std::vector<Dimension> &dimensions)
{
    const Type &type = db_.types[id];
    std::optional<std::int64_t> bits;
    if (!spend(1)) {
        return std::nullopt;
    }
    if (type.sort == Sort::aggregate) {
        bits = 0;
        for (const Member &member : type.members) {
            const auto one = size(member.type, {});
            bits = bits && one ? std::optional(*bits + *one) : std::nullopt;
        }
    } else if (type.sort == Sort::array) {
        const auto n = elements(dimensions.empty() ? type.dimensions : dimensions);
        const auto one = size(type.element, {});
        bits = n && one ? std::optional(static_cast<std::int64_t>(*n) * *one) : std::nullopt;
    } else if (type.encoding.bits != 0) {
        bits = type.encoding.bits;
    } else if (type.encoding.sized) {
        bits = number(type.encoding.size);
    }
    return bits && *bits >= 0 && *bits <= static_cast<std::int64_t>(n_bits_) ? bits : std::nullopt;
}

bool Decoder::take(Id parameter, Id id, std::uint32_t node, Walk &walk, const std::vector<Dimension> *dimensions)
{
    const Type &type = db_.types[id];
    if (!spend(1)) {
        return false;
    }
    if (type.sort == Sort::aggregate) {
        for (std::uint32_t i = 0; i < type.members.size(); i++) {
            nodes_.push_back({node, i, id});
            if (!take(parameter, type.members[i].type, static_cast<std::uint32_t>(nodes_.size() - 1), walk, nullptr)) {
                return false;
            }
        }
        return true;
    }
    if (type.sort == Sort::array) {
        const auto n = elements(dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions);
        if (!n || *n > most_fields) {
            return broken("the " + std::string(n ? "" : "size of the ") + "array " + db_.parameters[parameter].name +
                          (n ? " has more than 2^20 elements" : " is not known"));
        }
        for (std::uint32_t i = 0; i < *n; i++) { // of several dimensions, the last one counts fastest
            nodes_.push_back({node, i, id});
            if (!take(parameter, type.element, static_cast<std::uint32_t>(nodes_.size() - 1), walk, nullptr)) {
                return false;
            }
        }
        return true;
    }
    const Encoding &encoding = type.encoding;
    const std::size_t from = walk.at;
    Kind kind = raw_kind(encoding);
    std::uint64_t raw = 0, value = 0;
    Status status = Status::good;
    if (kind == Kind::text) {
        if (!take_text(type, walk, raw, value, status)) {
            return false;
        }
        if (type.sort != Sort::text) {
            const Status made = convert(type, kind, value, value);
            status = status == Status::good ? made : status;
        }
    } else if (kind == Kind::binary) {
        if (!take_binary(type, walk, raw)) {
            return false;
        }
        value = raw;
    } else {
        if (walk.at + encoding.bits > n_bits_) {
            return broken("the packet ends within " + db_.parameters[parameter].name);
        }
        if (number_of(encoding, load_bits(bytes_.data(), walk.at, encoding.bits), raw)) {
            status = convert(type, kind, raw, value);
        } else {
            status = Status::malformed;
        }
        walk.at += encoding.bits;
    }
    if (!encoding.algorithm.empty()) {
        status = Status::uncalibrated;
    }
    if (!plans_on_) {
        places_.push_back({from, walk.at - from});
    }
    fields_.push_back({parameter, id, node, kind, value_kind(type)});
    raw_.push_back(raw);
    values_.push_back(value);
    status_.push_back(status);
    return true;
}

bool Decoder::once(const Entry &entry, Walk &walk)
{
    if (entry.what == Entry::What::container) {
        if (++depth_ > 256) {
            return broken("containers are nested deeper than 256");
        }
        std::vector<Id> chain; // up to the one that extends nothing
        for (Id at = entry.id; at != no_id; at = db_.containers[at].base) {
            chain.push_back(at);
        }
        Walk inner{walk.at, walk.at, true};
        for (std::size_t i = chain.size(); i-- > 1;) {
            if (!entries(chain[i], inner)) {
                return false;
            }
        }
        const Outcome outcome = attempt(entry.id, inner, 0, true);
        depth_--;
        walk.at = end_;
        return outcome == Outcome::matched;
    }
    if (entry.what == Entry::What::parameter) {
        return take(entry.id, db_.parameters[entry.id].type, 0, walk, &entry.dimensions);
    }
    if (entry.what == Entry::What::indirect) {
        const auto found = find(entry.selector, true);
        const std::string wanted = found ? shown(*found) : "";
        for (Id i = 0; i < db_.parameters.size(); i++) {
            for (const auto &[space, alias] : db_.parameters[i].aliases) {
                if (space == entry.name && alias == wanted) {
                    const Id type = db_.parameters[i].type;
                    return db_.types[type].encoding.what != Encoding::What::none
                               ? spend(i) && take(i, type, 0, walk, nullptr)
                               : broken(db_.parameters[i].path + " has no encoding");
                }
            }
        }
        return broken("no parameter has the alias " + wanted + " in the name space " + entry.name);
    }
    if (entry.what == Entry::What::fixed) {
        walk.at += entry.bits;
        return walk.at <= n_bits_ || broken("the packet ends within a fixed value");
    }
    return broken("an argument of a command is no telemetry"); // a command's container as root
}

bool Decoder::entry(const Entry &entry, Walk &walk)
{
    if (!holds(entry.include, true)) {
        return spend(1);
    }
    const auto offset = number(entry.offset), n = entry.repeats ? number(entry.count) : std::optional<std::int64_t>(1);
    const auto gap = entry.repeats ? number(entry.gap) : std::optional<std::int64_t>(0);
    if (!offset || !n || !gap || *n < 0) {
        return broken("the place or the number of an entry is not known (" + db_.where(entry.place) + ")");
    }
    std::int64_t at = *offset + static_cast<std::int64_t>(entry.from == Entry::From::start ? walk.start : walk.at);
    if (entry.from == Entry::From::end) { // the entry's end is so far in front of the packet's
        const auto bits = entry.what == Entry::What::fixed       ? std::optional<std::int64_t>(entry.bits)
                          : entry.what == Entry::What::parameter ? size(db_.parameters[entry.id].type, entry.dimensions)
                                                                 : std::nullopt;
        if (walk.included || !bits) {
            return broken((walk.included ? "an entry at the end of a container that is in another is not decoded ("
                                         : "an entry at the end of a container needs a size (") +
                          db_.where(entry.place) + ")");
        }
        const Wide from = Wide(n_bits_) - *offset - Wide(*n) * *bits - std::max<Wide>(*n - 1, 0) * *gap;
        at = static_cast<std::int64_t>(std::clamp<Wide>(from, -1, Wide(n_bits_) + 1));
        walk.tail = std::min(walk.tail, static_cast<std::size_t>(std::max<std::int64_t>(at, 0)));
        walk.front = walk.back ? walk.front : walk.at;
    }
    walk.back = entry.from == Entry::From::end || (walk.back && entry.from == Entry::From::previous);
    for (std::int64_t i = 0; i < *n; i++) {
        if (at < 0 || at > static_cast<std::int64_t>(n_bits_)) {
            return broken("an entry begins at bit " + std::to_string(at) + ", and the packet has " +
                          std::to_string(n_bits_) + " (" + db_.where(entry.place) + ")");
        }
        walk.at = static_cast<std::size_t>(at);
        if (!spend(1) || !once(entry, walk)) {
            return false;
        }
        at = static_cast<std::int64_t>(walk.at) + *gap;
    }
    std::size_t &furthest = walk.back ? walk.end : walk.most;
    furthest = std::max(furthest, walk.at);
    return true;
}

/// Those that are placed from the end lie behind what heirs add: these go on in front of them.
bool Decoder::entries(Id container, Walk &walk)
{
    const auto &all = db_.containers[container].entries;
    const bool whole = std::all_of(all.begin(), all.end(), [&](const Entry &one) { return entry(one, walk); });
    if (!whole && !packet_.stopped) {
        packet_.stopped = walk.at;
    }
    walk.at = walk.back ? walk.front : walk.at;
    walk.back = false;
    return whole;
}

Decoder::Outcome Decoder::attempt(Id id, Walk walk, std::size_t depth, bool included)
{
    const Container &container = db_.containers[id];
    const std::size_t fields = fields_.size(), nodes = nodes_.size();
    const bool whole = entries(id, walk);
    if (!included) {
        found_ = id; // as far as the packet goes
    }
    if (!whole) {
        return Outcome::broken;
    }
    for (const Id heir : container.heirs) {
        if (!spend(1)) {
            return Outcome::broken;
        }
        if (holds(db_.containers[heir].restriction, false)) {
            const Outcome outcome = attempt(heir, walk, depth + 1, included);
            if (outcome != Outcome::unmatched) {
                return outcome;
            }
        }
    }
    if (!container.is_abstract || included) {
        if (!included) {
            found_ = id;
        }
        end_ = std::max(walk.at, walk.end);
        if (walk.most > walk.tail) {
            packet_.stopped = walk.tail;
            broken("the packet is " + std::to_string(walk.most - walk.tail) + " bits too short for " + container.path +
                   " and what stands at its end");
            return Outcome::broken;
        }
        return Outcome::matched;
    }
    say_why_not(id, depth);
    found_ = no_id;
    fields_.resize(fields);
    nodes_.resize(nodes);
    places_.resize(std::min(places_.size(), fields));
    raw_.resize(fields);
    values_.resize(fields);
    status_.resize(fields);
    return Outcome::unmatched;
}

// --- why not

std::string Decoder::shown(const Operand &operand) const
{
    switch (operand.kind) {
    case Kind::text: return std::string(operand.text);
    case Kind::label:
        return operand.word != no_id ? operand.type->enumerators[operand.word].label
                                     : std::to_string(static_cast<std::int64_t>(operand.raw));
    case Kind::boolean: return operand.word ? operand.type->one : operand.type->zero;
    case Kind::natural: return std::to_string(operand.word);
    case Kind::integer:
    case Kind::time: return std::to_string(static_cast<std::int64_t>(operand.word));
    case Kind::real: return std::to_string(bit_cast<double>(operand.word));
    default: return "bytes";
    }
}

/// The comparisons of a condition that do not hold, with what was found instead; at: of the first one, in the packet.
std::string Decoder::failing(const Condition &condition, std::optional<std::size_t> &at)
{
    if (holds(condition, false)) {
        return "";
    }
    if (condition.what == Condition::What::compare) {
        const auto found = find(condition.left, false);
        at = at || !found ? at : found->at;
        return condition.text + (found ? " (found " + shown(*found) + ")" : " (not in this packet)");
    }
    std::string all;
    for (const Condition &part : condition.parts) {
        if (all.size() > most_said) {
            return all + (condition.what == Condition::What::any ? " or more" : " and more");
        }
        const std::string one = failing(part, at);
        all += (all.empty() || one.empty() ? "" : condition.what == Condition::What::any ? " or " : " and ") + one;
    }
    return all;
}

std::optional<double> Decoder::real(const Reference &reference)
{
    const auto found = find(reference, true);
    return found ? real_of(found->kind, found->word) : std::nullopt;
}

std::string Decoder::words(const Reference &reference)
{
    const auto found = find(reference, true);
    return found ? shown(*found) : "";
}

void Decoder::say_why_not(Id id, std::size_t depth)
{
    if (depth < best_) {
        return; // another one came nearer
    }
    best_ = depth + 1;
    const Container &container = db_.containers[id];
    packet_.nearest = id;
    packet_.stopped.reset();
    packet_.reason = container.path + " is abstract, and no container extends it";
    std::size_t fewest = ~std::size_t(0);
    for (const Id heir : container.heirs) {
        std::optional<std::size_t> at;
        const std::string needs = failing(db_.containers[heir].restriction, at);
        const auto n = static_cast<std::size_t>(std::count(needs.begin(), needs.end(), '('));
        if (!needs.empty() && n < fewest) {
            fewest = n;
            packet_.nearest = heir;
            packet_.stopped = at;
            packet_.reason = "no container that extends " + container.path + " fits; the nearest, " +
                             db_.containers[heir].path + ", needs " + needs;
        }
    }
}

// --- plans

const Decoder::Plan &Decoder::plan(Id container)
{
    if (!plans_[container]) {
        plans_[container] = std::make_unique<Plan>();
        const std::size_t effort = effort_; // of the packet, which did not ask for this
        effort_ = 0;
        if (laid_ < most_laid && planned_fields_ < most_planned) {
            make_plan(*plans_[container], container);
        }
        laid_ += effort_ + plans_[container]->fields.size();
        effort_ = effort;
    }
    return *plans_[container];
}

void Decoder::make_plan(Plan &made, Id id)
{
    const Container &container = db_.containers[id];
    std::size_t at = 0;
    if (container.base != no_id) {
        const Plan &base = plan(container.base);
        if (!base.fixed) {
            return;
        }
        made.fields = base.fields;
        made.places = base.places;
        made.nodes = base.nodes;
        made.most = base.most;
        at = base.end;
        effort_ += base.fields.size();
    }
    made.fixed = lay_entries(made, id, at, 0);
    planned_fields_ += made.fields.size();
    if (!made.fixed || planned_fields_ > most_planned) {
        made = Plan();
        return;
    }
    made.end = at;
    join_steps(made);
    for (std::uint32_t i = 0; i < made.fields.size(); i++) {
        if (const auto slots = slots_.find(made.fields[i].parameter); slots != slots_.end()) {
            for (const std::uint32_t slot : slots->second) {
                if (leads(held_[slot].reference, made.nodes, made.fields[i].node)) {
                    made.held.emplace_back(i, slot);
                }
            }
        }
    }

    // The raw number that most heirs ask for.
    const auto asked = [&](const Condition &one) -> std::optional<std::pair<std::size_t, std::uint64_t>> {
        if (one.what != Condition::What::compare || one.op != Operator::equal || !one.literal.integer ||
            one.right.of != Reference::Of::nothing || one.left.of != Reference::Of::parameter) {
            return std::nullopt;
        }
        for (std::size_t i = made.fields.size(); i-- > 0;) {
            const Field &field = made.fields[i];
            if (field.parameter == one.left.parameter && leads(one.left, made.nodes, field.node)) {
                const bool raw = field.raw == Kind::natural && (!one.left.calibrated || field.value == Kind::natural);
                return raw && wide(one.literal) >= 0
                           ? std::optional(std::pair(i, static_cast<std::uint64_t>(*one.literal.integer)))
                           : std::nullopt;
            }
        }
        return std::nullopt;
    };
    std::unordered_map<std::size_t, std::size_t> counts;
    std::vector<std::unordered_map<std::size_t, std::uint64_t>> keys;
    for (const Id heir : container.heirs) {
        const Condition &all = db_.containers[heir].restriction;
        auto &mine = keys.emplace_back();
        for (const Condition &one : all.what == Condition::What::all ? all.parts : std::vector{all}) {
            if (const auto key = asked(one); key && mine.insert(*key).second) {
                counts[key->first]++;
            }
        }
    }
    const auto chosen = std::max_element(counts.begin(), counts.end(), [](auto &a, auto &b) {
        return std::pair(a.second, b.first) < std::pair(b.second, a.first);
    });
    const auto affordable = [&](std::size_t keyed) { return keyed * (keys.size() - keyed) <= most_planned; };
    if (chosen != counts.end() && chosen->second > 1 && affordable(chosen->second)) {
        const std::size_t field = chosen->first;
        made.dispatch.at = made.places[field];
        made.dispatch.encoding = &db_.types[made.fields[field].type].encoding;
        for (const auto &mine : keys) {
            if (const auto key = mine.find(field); key != mine.end()) {
                made.dispatch.heirs[key->second];
            }
        }
        for (std::size_t i = 0; i < keys.size(); i++) {
            if (const auto key = keys[i].find(field); key != keys[i].end()) {
                made.dispatch.heirs[key->second].push_back(container.heirs[i]);
                continue;
            }
            made.dispatch.others.push_back(container.heirs[i]);
            for (auto &[value, heirs] : made.dispatch.heirs) {
                heirs.push_back(container.heirs[i]);
            }
        }
    }
    std::size_t n = 0;
    made.searches = std::any_of(container.heirs.begin(), container.heirs.end(), [&](Id heir) {
        n += comparisons(db_.containers[heir].restriction) * made.fields.size();
        return n > most_compared || by_more_than_numbers(made, db_.containers[heir].restriction);
    });
}

/// Whether a restriction asks for texts, bytes, or members without their parameter.
bool Decoder::by_more_than_numbers(const Plan &made, const Condition &condition) const
{
    for (const Reference *one : {&condition.left, &condition.right}) {
        if (one->of == Reference::Of::argument ||
            std::any_of(made.fields.begin(), made.fields.end(), [&](const Field &field) {
                return field.parameter == one->parameter && (field.raw == Kind::text || field.raw == Kind::binary);
            })) {
            return true;
        }
    }
    return std::any_of(condition.parts.begin(), condition.parts.end(),
                       [&](const Condition &part) { return by_more_than_numbers(made, part); });
}

bool Decoder::lay_entries(Plan &made, Id id, std::size_t &at, std::size_t start)
{
    for (const Entry &entry : db_.containers[id].entries) {
        const bool container = entry.what == Entry::What::container;
        if (entry.include.what != Condition::What::always || entry.from == Entry::From::end ||
            !entry.offset.is_fixed() || !entry.count.is_fixed() || !entry.gap.is_fixed() ||
            (container ? !db_.containers[entry.id].heirs.empty() || db_.containers[entry.id].base != no_id
                       : entry.what != Entry::What::parameter)) {
            return false;
        }
        const std::int64_t n = entry.repeats ? entry.count.fixed : 1, gap = entry.repeats ? entry.gap.fixed : 0;
        std::int64_t from =
            static_cast<std::int64_t>(entry.from == Entry::From::start ? start : at) + entry.offset.fixed;
        if (n < 0 || n > 1 << 16) {
            return false;
        }
        for (std::int64_t i = 0; i < n; i++) {
            if (from < 0 || from > 8 * 65542) {
                return false;
            }
            at = static_cast<std::size_t>(from);
            made.most = std::max(made.most, at); // a place beyond the end is a fault, even without bits
            if (!(container ? lay_entries(made, entry.id, at, at)
                            : lay(made, entry.id, db_.parameters[entry.id].type, 0, at, &entry.dimensions))) {
                return false;
            }
            from = static_cast<std::int64_t>(at) + gap;
            if (made.fields.size() > 1 << 16 || ++effort_ > most_effort) {
                return false;
            }
        }
    }
    return true;
}

bool Decoder::lay(Plan &made, Id parameter, Id id, std::uint32_t node, std::size_t &at,
                  const std::vector<Dimension> *dimensions)
{
    const Type &type = db_.types[id];
    const Encoding &encoding = type.encoding;
    if (made.fields.size() > 1 << 16 || ++effort_ > most_effort) {
        return false;
    }
    if (type.sort == Sort::aggregate || type.sort == Sort::array) {
        std::int64_t n = type.sort == Sort::aggregate ? static_cast<std::int64_t>(type.members.size()) : 1;
        if (type.sort == Sort::array) {
            for (const Dimension &one : dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions) {
                const std::int64_t many = one.last.fixed - one.first.fixed + 1;
                if (!one.first.is_fixed() || !one.last.is_fixed() || many < 0 || many > 1 << 16 ||
                    (n *= many) > 1 << 16) {
                    return false;
                }
            }
        }
        for (std::uint32_t i = 0; i < n; i++) {
            made.nodes.push_back({node, i, id});
            if (!lay(made, parameter, type.sort == Sort::array ? type.element : type.members[i].type,
                     static_cast<std::uint32_t>(made.nodes.size() - 1), at, nullptr)) {
                return false;
            }
        }
        return true;
    }
    if (refers(type) || !encoding.algorithm.empty() || encoding.what == Encoding::What::none ||
        (encoding.bits == 0 && (!encoding.sized || !encoding.size.is_fixed() ||
                                encoding.size.fixed < static_cast<std::int64_t>(encoding.size_tag)))) {
        return false;
    }
    made.fields.push_back({parameter, id, node, raw_kind(encoding), value_kind(type)});
    made.places.push_back(at);
    at += encoding.bits != 0 ? encoding.bits : static_cast<std::size_t>(encoding.size.fixed);
    made.most = std::max(made.most, at);
    return true;
}

void Decoder::join_steps(Plan &made) const
{
    using Load = Plan::Load;
    using Make = Plan::Make;
    for (std::uint32_t i = 0; i < made.fields.size(); i++) {
        const Field &field = made.fields[i];
        const Type &type = db_.types[field.type];
        const Encoding &encoding = type.encoding;
        const bool whole = made.places[i] % 8 == 0 && encoding.byte_order.empty() && !encoding.bits_reversed;
        const unsigned bits = encoding.bits;
        Plan::Step step{Load::other, Make::other, i, 1, bits, made.places[i], &type};
        const Calibrator &calibrator = encoding.calibrator;
        if (encoding.form == NumberForm::ieee754 && whole && (bits == 32 || bits == 64)) {
            step.load = bits == 32 ? Load::f32 : Load::f64;
        } else if (encoding.form == NumberForm::plain && field.raw == Kind::natural && !encoding.bits_reversed &&
                   encoding.byte_order.empty()) {
            step.load = !whole       ? Load::bits
                        : bits == 8  ? Load::u8
                        : bits == 16 ? Load::u16
                        : bits == 32 ? Load::u32
                        : bits == 64 ? Load::u64
                                     : Load::bits;
        } else if (encoding.form == NumberForm::twos_complement && whole && (bits == 8 || bits == 16 || bits == 32)) {
            step.load = bits == 8 ? Load::i8 : bits == 16 ? Load::i16 : Load::i32;
        }
        if (step.load != Load::other) {
            const bool plain = calibrator.what == Calibrator::What::none;
            if (plain && (field.raw == field.value)) {
                step.make = Make::same;
            } else if (plain && field.value == Kind::real) {
                step.make = field.raw == Kind::natural ? Make::from_natural : Make::from_integer;
            } else if (!calibrator.coefficients.empty() && field.value == Kind::real) {
                step.make = Make::line;
            }
        }
        Plan::Step *last = made.steps.empty() ? nullptr : &made.steps.back();
        if (last != nullptr && step.load != Load::other && last->load == step.load && last->make == step.make &&
            last->bits == bits && last->at + last->n * bits == step.at &&
            (step.make == Make::same || step.make == Make::from_natural || step.make == Make::from_integer ||
             last->type == &type)) {
            last->n++;
        } else {
            made.steps.push_back(step);
        }
    }
}

bool Decoder::holds_planned(const Plan &made, const Condition &condition) const
{
    const auto operand = [&](const Reference &reference) -> std::optional<Operand> {
        for (std::size_t i = made.fields.size(); i-- > 0;) {
            const Field &field = made.fields[i];
            if (field.parameter == reference.parameter && leads(reference, made.nodes, field.node)) {
                const Type &type = db_.types[field.type];
                std::uint64_t raw = 0, value = 0;
                if (!number_of(type.encoding, load_bits(bytes_.data(), made.places[i], type.encoding.bits), raw)) {
                    return std::nullopt;
                }
                if (!reference.calibrated) {
                    return Operand{field.raw, raw, &type, raw};
                }
                // Nothing that `convert` changes: a planned type refers to no other value.
                const Status status = const_cast<Decoder *>(this)->convert(type, field.raw, raw, value);
                return status == Status::uncalibrated ? std::nullopt
                                                      : std::optional(Operand{field.value, value, &type, raw});
            }
        }
        return std::nullopt;
    };
    switch (condition.what) {
    case Condition::What::always: return true;
    case Condition::What::all:
        return std::all_of(condition.parts.begin(), condition.parts.end(),
                           [&](const Condition &one) { return holds_planned(made, one); });
    case Condition::What::any:
        return std::any_of(condition.parts.begin(), condition.parts.end(),
                           [&](const Condition &one) { return holds_planned(made, one); });
    case Condition::What::compare: break;
    }
    const auto left = operand(condition.left);
    if (!left || condition.right.of == Reference::Of::nothing) {
        return left && compare(condition.op, *left, condition.literal);
    }
    const auto right = operand(condition.right);
    return right && compare(condition.op, *left, *right);
}

/// The container of the packet, if plans lead to it and it is long enough; else no_id.
Id Decoder::planned(Id id, std::size_t bits)
{
    const Plan &made = plan(id);
    if (!made.fixed || made.searches || made.most > bits) {
        return no_id;
    }
    const Container &container = db_.containers[id];
    std::span<const Id> heirs = container.heirs;
    if (made.dispatch.encoding != nullptr) {
        std::uint64_t key = 0;
        number_of(*made.dispatch.encoding, load_bits(bytes_.data(), made.dispatch.at, made.dispatch.encoding->bits),
                  key);
        const auto found = made.dispatch.heirs.find(key);
        heirs = found != made.dispatch.heirs.end() ? found->second : made.dispatch.others;
    }
    for (const Id heir : heirs) {
        if (holds_planned(made, db_.containers[heir].restriction)) {
            return planned(heir, bits); // one that turns out not to fit is left to the search entry by entry
        }
    }
    return container.is_abstract ? no_id : id;
}

namespace {

template <class Unsigned, class Signed = Unsigned>
void load_all(const std::uint8_t *p, std::size_t n, std::uint64_t *raw)
{
    for (std::size_t i = 0; i < n; i++) {
        Unsigned one;
        std::memcpy(&one, p + i * sizeof one, sizeof one);
        if constexpr (std::endian::native == std::endian::little) {
            if constexpr (sizeof one == 2) {
                one = __builtin_bswap16(one);
            } else if constexpr (sizeof one == 4) {
                one = __builtin_bswap32(one);
            } else if constexpr (sizeof one == 8) {
                one = __builtin_bswap64(one);
            }
        }
        if constexpr (std::is_same_v<Signed, float>) {
            raw[i] = word(static_cast<double>(bit_cast<float>(one)));
        } else if constexpr (std::is_signed_v<Signed>) {
            raw[i] = static_cast<std::uint64_t>(static_cast<std::int64_t>(static_cast<Signed>(one)));
        } else {
            raw[i] = one;
        }
    }
}

} // namespace

void Decoder::run(const Plan &made)
{
    using Load = Plan::Load;
    using Make = Plan::Make;
    const std::size_t n_fields = made.fields.size();
    if (raw_.size() < n_fields) {
        raw_.resize(n_fields);
        values_.resize(n_fields);
        status_.resize(n_fields);
    }
    std::memset(status_.data(), 0, n_fields);
    for (const Plan::Step &step : made.steps) {
        const std::uint8_t *const p = bytes_.data() + step.at / 8;
        std::uint64_t *const raw = raw_.data() + step.first;
        std::uint64_t *const values = values_.data() + step.first;
        const std::size_t n = step.n;
        switch (step.load) {
        case Load::u8: load_all<std::uint8_t>(p, n, raw); break;
        case Load::u16: load_all<std::uint16_t>(p, n, raw); break;
        case Load::u32: load_all<std::uint32_t>(p, n, raw); break;
        case Load::u64:
        case Load::f64: load_all<std::uint64_t>(p, n, raw); break;
        case Load::i8: load_all<std::uint8_t, std::int8_t>(p, n, raw); break;
        case Load::i16: load_all<std::uint16_t, std::int16_t>(p, n, raw); break;
        case Load::i32: load_all<std::uint32_t, std::int32_t>(p, n, raw); break;
        case Load::f32: load_all<std::uint32_t, float>(p, n, raw); break;
        case Load::bits:
            for (std::size_t i = 0; i < n; i++) {
                raw[i] = load_bits(bytes_.data(), step.at + i * step.bits, step.bits);
            }
            break;
        case Load::other: {
            const Type &type = *step.type;
            Status &status = status_[step.first];
            const Kind kind = raw_kind(type.encoding);
            Walk walk{step.at, 0};
            raw[0] = values[0] = 0;
            if (kind == Kind::text) {
                take_text(type, walk, raw[0], values[0], status);
                if (type.sort != Sort::text) {
                    const Status made_status = convert(type, kind, values[0], values[0]);
                    status = status == Status::good ? made_status : status;
                }
            } else if (kind == Kind::binary) {
                take_binary(type, walk, raw[0]);
                values[0] = raw[0];
            } else if (number_of(type.encoding, load_bits(bytes_.data(), step.at, step.bits), raw[0])) {
                status = convert(type, kind, raw[0], values[0]);
            } else {
                status = Status::malformed;
            }
            continue;
        }
        }
        switch (step.make) {
        case Make::same: std::memcpy(values, raw, 8 * n); break;
        case Make::from_natural:
            for (std::size_t i = 0; i < n; i++) {
                values[i] = word(static_cast<double>(raw[i]));
            }
            break;
        case Make::from_integer:
            for (std::size_t i = 0; i < n; i++) {
                values[i] = word(static_cast<double>(static_cast<std::int64_t>(raw[i])));
            }
            break;
        case Make::line:
            for (std::size_t i = 0; i < n; i++) {
                const double y = polynomial(step.type->encoding.calibrator.coefficients,
                                            *real_of(made.fields[step.first].raw, raw[i]));
                values[i] = word(y);
                if (y != y) {
                    values[i] = word(std::nan(""));
                    status_[step.first + i] = Status::uncalibrated;
                }
            }
            break;
        case Make::other:
            for (std::size_t i = 0; i < n; i++) {
                status_[step.first + i] = convert(*step.type, made.fields[step.first].raw, raw[i], values[i]);
            }
            break;
        }
    }
}

// --- both

const Decoded &Decoder::decode(std::span<const std::uint8_t> packet, Id root)
{
    packet_ = Decoded();
    fields_.clear();
    used_ = packet.size() + padding;
    n_bits_ = 8 * packet.size();
    effort_ = depth_ = best_ = end_ = 0;
    broken_ = false;
    found_ = no_id;
    const std::span<const Id> roots = root != no_id ? std::span<const Id>(&root, 1) : roots_;
    if (packet.size() > most_bytes / 2 || roots.empty()) {
        packet_.reason = roots.empty() ? "the database has no container" : "the packet has more than 32 MB";
        return packet_;
    }
    bytes_.resize(std::max(bytes_.size(), used_));
    std::copy(packet.begin(), packet.end(), bytes_.begin());
    std::memset(bytes_.data() + packet.size(), 0, padding);
    std::size_t n = 0;
    for (const Id one : roots) {
        found_ = plans_on_ ? planned(one, n_bits_) : no_id;
        if (found_ != no_id) {
            const Plan &made = *plans_[found_];
            run(made);
            packet_.planned = true;
            packet_.nearest = no_id;
            packet_.reason.clear(); // of roots before
            packet_.stopped.reset();
            packet_.fields = made.fields;
            packet_.nodes = made.nodes;
            end_ = made.end;
            n = made.fields.size();
            for (const auto &[field, slot] : made.held) {
                keep(field, slot);
            }
            break;
        }
        nodes_.assign(1, {0, 0, no_id});
        places_.clear();
        raw_.clear();
        values_.clear();
        status_.clear();
        const Outcome outcome = attempt(one, {0, 0}, 0, false);
        if (outcome == Outcome::unmatched) {
            continue;
        }
        packet_.fields = fields_;
        packet_.nodes = nodes_;
        n = fields_.size();
        if (outcome == Outcome::matched) {
            packet_.reason.clear(); // of roots before
            packet_.stopped.reset();
        }
        packet_.nearest = no_id;
        for (std::size_t i = 0; i < n && !slots_.empty(); i++) {
            if (const auto slots = slots_.find(fields_[i].parameter); slots != slots_.end()) {
                for (const std::uint32_t slot : slots->second) {
                    if (leads(held_[slot].reference, nodes_, fields_[i].node)) {
                        keep(i, slot);
                    }
                }
            }
        }
        break;
    }
    packet_.container = found_;
    packet_.raw = {raw_.data(), n};
    packet_.values = {values_.data(), n};
    packet_.status = {status_.data(), n};
    packet_.bytes = {bytes_.data(), used_};
    packet_.places = places_;
    packet_.bits = end_;
    return packet_;
}

std::string suffix(const Database &database, const Decoded &packet, std::size_t field)
{
    std::string path;
    for (std::uint32_t node = packet.fields[field].node; node != 0; node = packet.nodes[node].parent) {
        const PathNode &one = packet.nodes[node];
        const Type &type = database.types[one.type];
        path = (type.sort == Sort::array ? "[" + std::to_string(one.place) + "]" : "." + type.members[one.place].name) +
               path;
    }
    return path;
}

} // namespace fledge::ground

// SPDX-License-Identifier: Apache-2.0
// Values to which others refer, of this packet and of earlier ones; conditions; conversion of raw to calibrated values.
#include "ground/database/decoder_parts.h"
#include "ground/database/times.h"

#include <algorithm>
#include <cmath>

namespace fledge::ground {

namespace {

constexpr std::size_t most_held = 256; // members and elements of a parameter to which others refer

using Sort = Type::Sort;

} // namespace

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

std::optional<Operand> Decoder::find(const Reference &reference, bool earlier)
{
    const auto operand = [&](const Field &field, std::uint64_t raw, std::uint64_t value, Status status,
                             std::string_view text) -> std::optional<Operand> {
        const bool calibrated = reference.calibrated && field.value != Kind::none;
        if (status == Status::malformed || (calibrated && status == Status::uncalibrated)) {
            return std::nullopt;
        }
        return Operand{calibrated ? field.value : field.raw,
                       calibrated ? value : raw,
                       &db_.types[field.type],
                       field.raw,
                       raw,
                       text};
    };
    const bool named = reference.of == Reference::Of::argument; // or a member of the same aggregate
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
    const Operand value = constant(type, *initial);
    return reference.calibrated || value.kind != Kind::label ? value : Operand{value.raw_kind, value.raw, &type};
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
    const auto value = found ? number_of(*found) : std::nullopt;
    if (!value || !(std::abs(value->real() * quantity.slope + quantity.intercept) < 1e15)) {
        return std::nullopt;
    }
    return nearest(value->real() * quantity.slope + quantity.intercept);
}

/// The size [bits] of a value that begins at a bit.
std::optional<std::int64_t> Decoder::size_at(const Quantity &quantity, std::size_t at)
{
    return quantity.from.of == Reference::Of::rest
               ? static_cast<std::int64_t>(n_bits_ - at) + static_cast<std::int64_t>(quantity.intercept)
               : number(quantity);
}

// --- conditions

bool Decoder::holds(const Condition &condition, bool earlier)
{
    if (effort_ > most_effort) {
        return false; // the next entry reports the reason
    }
    switch (condition.kind) {
    case Condition::Kind::always: return true;
    case Condition::Kind::all:
        return std::all_of(condition.parts.begin(), condition.parts.end(),
                           [&](auto &part) { return holds(part, earlier); });
    case Condition::Kind::any:
        return std::any_of(condition.parts.begin(), condition.parts.end(),
                           [&](auto &part) { return holds(part, earlier); });
    case Condition::Kind::compare: break;
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
    const bool calibrates = type.encoding.calibrator.kind != Calibrator::Kind::none || !type.encoding.contexts.empty();
    if (!type.encoding.algorithm.empty() || raw == Kind::none) {
        return Kind::none;
    }
    switch (type.sort) {
    case Sort::integer:
        return !calibrates && raw != Kind::real && raw != Kind::text                      ? raw
               : !type.is_signed && (type.encoding.bits == 64 || type.encoding.bits == 0) ? Kind::natural
                                                                                          : Kind::integer;
    case Sort::real: return Kind::real;
    case Sort::enumerated: return Kind::label;
    case Sort::boolean: return Kind::boolean;
    case Sort::text: return raw == Kind::text || raw == Kind::binary ? Kind::text : raw;
    case Sort::binary: return raw == Kind::text || raw == Kind::binary ? Kind::binary : raw;
    case Sort::absolute_time: return type.epoch ? Kind::time : Kind::duration;
    case Sort::relative_time: return Kind::duration;
    default: return Kind::none;
    }
}

bool Decoder::refers(const Type &type) const
{
    return !type.encoding.contexts.empty() || type.encoding.calibrator.refers ||
           type.offset_from.of != Reference::Of::nothing;
}

std::uint64_t Decoder::label(const Type &type, const Number &number) const
{
    const auto word = word_of(Kind::integer, number);
    if (type.enumerators.empty() || !word) {
        return no_id;
    }
    const auto raw = static_cast<std::int64_t>(*word);
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

/// Convert a text to a type's value; returns nothing if it is a number, which is now in kind and raw.
std::optional<Status> Decoder::convert_text(const Type &type, Kind &kind, std::uint64_t &raw,
                                            std::uint64_t &value) const
{
    const std::string_view text = text_of(raw);
    const auto number = number_in(text);
    switch (type.sort) {
    case Sort::integer: {
        const auto whole = number && number->is_whole() ? word_of(value_kind(type), *number) : std::nullopt;
        value = whole.value_or(0);
        return whole ? Status::good : Status::malformed;
    }
    case Sort::real:
    case Sort::absolute_time:
    case Sort::relative_time:
        if (const auto ns = time_of(type, text)) {
            value = static_cast<std::uint64_t>(*ns);
            return Status::good;
        }
        if (number) {
            kind = Kind::real, raw = word(number->real());
            return std::nullopt;
        }
        value = word(std::nan(""));
        return Status::malformed;
    case Sort::enumerated:
        for (value = 0; value < type.enumerators.size(); value++) {
            if (type.enumerators[value].label == text) {
                return Status::good;
            }
        }
        value = no_id;
        return Status::unlabelled;
    case Sort::boolean:
        value = text == type.one_label;
        return value || text == type.zero_label ? Status::good : Status::malformed;
    default: value = raw; return Status::good;
    }
}

/// [ns] of TAI at a value of UTC. That does not tell whether it lies in a leap second or behind it: its count from an
/// epoch does.
static Wide tai_of(const Operand &time)
{
    const Wide tai = tai_of_utc(static_cast<std::int64_t>(time.word));
    const Type &type = *time.type;
    const auto raw = number_of(time.raw_kind, time.raw);
    if (!raw || type.offset_from.of != Reference::Of::nothing || !type.epoch || !type.epoch->leap_seconds ||
        type.encoding.calibrator.kind != Calibrator::Kind::none || !type.encoding.contexts.empty()) {
        return tai;
    }
    const long double since = raw->extended() * type.scale + type.offset;
    return type.epoch->ns + since < tai - one_second / 2.0L ? tai - one_second : tai;
}

/// Convert a time since the epoch or since another value, or a duration, to which another duration may be added.
Status Decoder::convert_time(const Type &type, const Number &number, std::uint64_t &value)
{
    Wide sum = type.epoch ? type.epoch->ns : 0;
    if (type.offset_from.of != Reference::Of::nothing) {
        const auto found = find(type.offset_from, true);
        const auto seconds = found ? number_of(*found) : std::nullopt;
        if (!seconds) {
            return Status::uncalibrated;
        }
        const auto ns = static_cast<std::int64_t>(found->word);
        sum = found->kind == Kind::duration ? ns
              : found->kind != Kind::time   ? nearest(seconds->real() * 1e9)
              : !type.epoch                 ? 0
              : type.epoch->leap_seconds    ? tai_of(*found)
                                            : ns;
    }
    const Number since = number * exactly(type.scale) + exactly(type.offset);
    if (since.is_whole()) {
        constexpr Wide most = Wide(1) << 64; // so that leap seconds may be added
        if (__builtin_add_overflow(sum, since.whole(), &sum) || sum > most || sum < -most) {
            return Status::uncalibrated;
        }
    } else { // a product of 64 bits and a scale as 2^-32 s needs more than a double
        const long double ns = number.extended() * type.scale + type.offset;
        if (!(std::abs(ns) < 9e18L)) {
            return Status::uncalibrated;
        }
        sum += std::llround(ns);
    }
    sum = type.epoch && type.epoch->leap_seconds ? utc_of_tai(sum) : sum;
    if (sum != static_cast<std::int64_t>(sum)) {
        return Status::uncalibrated;
    }
    value = static_cast<std::uint64_t>(sum);
    return Status::good;
}

Status Decoder::convert(const Type &type, Kind kind, std::uint64_t raw, std::uint64_t &value)
{
    const Encoding &encoding = type.encoding;
    const Calibrator *calibrator = encoding.calibrator.kind != Calibrator::Kind::none ? &encoding.calibrator : nullptr;
    for (const auto &[condition, other] : encoding.contexts) {
        if (holds(condition, true)) {
            calibrator = &other;
            break;
        }
    }
    value = 0;
    if (kind == Kind::text) { // the slice is UTF-8
        if (const auto status = convert_text(type, kind, raw, value)) {
            return *status;
        }
    }
    if (kind == Kind::binary) {
        value = raw;
        return Status::good;
    }
    Number number = *number_of(kind, raw);
    if (calibrator != nullptr) {
        if (type.sort == Sort::real && calibrator->kind == Calibrator::Kind::polynomial) {
            number = number.real(); // as in the loops of plans
        }
        const auto result =
            calibrated(*calibrator, number, [&](const Reference &reference) { return this->number(reference); });
        if (!result) {
            value = type.sort == Sort::real ? word(std::nan("")) : type.sort == Sort::enumerated ? no_id : 0;
            return Status::uncalibrated;
        }
        number = *result;
    }
    switch (type.sort) {
    case Sort::integer: {
        const auto whole = word_of(value_kind(type), number);
        value = whole.value_or(0);
        return whole ? Status::good : Status::uncalibrated;
    }
    case Sort::real: value = word(number.real()); break;
    case Sort::boolean: value = number != 0; break;
    case Sort::enumerated: value = label(type, number); return value == no_id ? Status::unlabelled : Status::good;
    case Sort::absolute_time:
    case Sort::relative_time: return convert_time(type, number, value);
    default: value = raw;
    }
    return Status::good;
}

} // namespace fledge::ground

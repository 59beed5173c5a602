// SPDX-License-Identifier: Apache-2.0
#include "ground/database/operand.h"

#include "ground/database/decoder.h"
#include "ground/database/times.h"

#include <algorithm>

namespace fledge::ground {

namespace {

bool ordered(Operator op, std::partial_ordering order)
{
    switch (op) {
    case Operator::equal: return order == 0;
    case Operator::unequal: return order != 0;
    case Operator::less: return order < 0;
    case Operator::at_most: return order <= 0;
    case Operator::more: return order > 0;
    case Operator::at_least: return order >= 0;
    }
    return false;
}

/// Bytes as a number: without the zeros in front.
std::partial_ordering order_of_bytes(std::string_view a, std::string_view b)
{
    a.remove_prefix(std::min(a.find_first_not_of('\0'), a.size()));
    b.remove_prefix(std::min(b.find_first_not_of('\0'), b.size()));
    return a.size() != b.size() ? a.size() <=> b.size() : a <=> b;
}

std::string_view name_of(const Operand &operand)
{
    return operand.kind == Kind::text ? operand.text
           : operand.word != no_id    ? std::string_view(operand.type->enumerators[operand.word].label)
                                      : std::string_view();
}

/// The lowest number of a label; of none, the number itself.
std::optional<Number> place_of(const Operand &label)
{
    return label.word != no_id ? Number(label.type->enumerators[label.word].low) : number_of(label);
}

} // namespace

std::optional<std::string> bytes_in(const std::string &text)
{
    std::string_view digits = trimmed(text);
    digits.remove_prefix(digits.starts_with("0x") || digits.starts_with("0X") ? 2 : 0);
    const auto bytes = octets_in(digits);
    return bytes ? std::optional(std::string(bytes->begin(), bytes->end())) : std::nullopt;
}

std::optional<Number> number_of(const Operand &operand)
{
    if (operand.kind != Kind::label) {
        return number_of(operand.kind, operand.word);
    }
    const auto raw = number_of(operand.raw_kind, operand.raw);
    return raw || operand.word == no_id ? raw : Number(operand.type->enumerators[operand.word].low);
}

std::string shown(const Operand &operand)
{
    if (operand.kind == Kind::text || (operand.kind == Kind::label && operand.word != no_id)) {
        return std::string(name_of(operand));
    }
    if (operand.kind == Kind::label && !operand.text.empty()) { // of no enumerator
        return std::string(operand.text);
    }
    if (operand.kind == Kind::boolean) {
        return operand.word ? operand.type->one_label : operand.type->zero_label;
    }
    if (is_time(operand.kind)) {
        return time_text(operand.kind, static_cast<std::int64_t>(operand.word));
    }
    const auto number = number_of(operand);
    return number ? text_of(*number) : "bytes";
}

std::optional<bool> truth(const Type &type, std::string_view text)
{
    const bool is_one = text == type.one_label, is_zero = text == type.zero_label;
    if (is_one || is_zero) {
        return is_one;
    }
    const bool is_true = text == "true" || text == "True" || text == "1";
    return is_true || text == "false" || text == "False" || text == "0" ? std::optional(is_true) : std::nullopt;
}

Operand operand_of(const Type &type, const Number &number)
{
    const auto whole = word_of(Kind::integer, number);
    switch (type.sort) {
    case Type::Sort::enumerated: {
        const auto found =
            std::find_if(type.enumerators.begin(), type.enumerators.end(), [&](const Enumerator &enumerator) {
                return number >= enumerator.low && number <= enumerator.high;
            });
        const auto place = static_cast<std::uint64_t>(found - type.enumerators.begin());
        return {Kind::label, found != type.enumerators.end() ? place : no_id, &type, Kind::integer, whole.value_or(0)};
    }
    case Type::Sort::boolean: return {Kind::boolean, number != 0, &type};
    case Type::Sort::absolute_time:
    case Type::Sort::relative_time: return {value_kind(type), whole.value_or(0), &type};
    default:
        return number.is_whole() && whole ? Operand{Kind::integer, *whole, &type}
               : number.is_whole() && word_of(Kind::natural, number)
                   ? Operand{Kind::natural, *word_of(Kind::natural, number), &type}
                   : Operand{Kind::real, std::bit_cast<std::uint64_t>(number.real()), &type};
    }
}

Operand constant(const Type &type, std::string_view text)
{
    auto number = number_in(text);
    switch (type.sort) {
    case Type::Sort::integer:
    case Type::Sort::real: break;
    case Type::Sort::enumerated:
        for (const Enumerator &enumerator : type.enumerators) {
            number = enumerator.label == text ? Number(enumerator.low) : number;
        }
        break;
    case Type::Sort::boolean:
        if (const auto is_true = truth(type, text)) {
            number = *is_true;
        }
        break;
    case Type::Sort::absolute_time:
    case Type::Sort::relative_time:
        number = number ? std::optional(*number * one_second) : number;
        if (const auto ns = time_of(type, trimmed(text))) {
            number = *ns;
        }
        break;
    default: number.reset();
    }
    return number ? operand_of(type, *number) : Operand{.kind = Kind::text, .word = 0, .type = &type, .text = text};
}

bool has_value(const Type &type, bool calibrated, const Literal &literal)
{
    using Sort = Type::Sort;
    const auto encoded = type.encoding.kind;
    if (!calibrated && (encoded == Encoding::Kind::integer || encoded == Encoding::Kind::real)) {
        return literal.number.has_value();
    }
    switch (calibrated ? type.sort : encoded == Encoding::Kind::binary ? Sort::binary : Sort::text) {
    case Sort::text:
    case Sort::aggregate:
    case Sort::array: return true;
    case Sort::binary: return bytes_in(literal.text).has_value();
    case Sort::absolute_time:
    case Sort::relative_time:
        if (encoded == Encoding::Kind::none) { // in no packet: whether it is a date or a duration is not known
            return true;
        }
        break;
    default: break;
    }
    return constant(type, literal.text).kind != Kind::text;
}

bool compare(Operator op, const Operand &left, const Literal &literal)
{
    const Type &type = *left.type;
    const auto &number = literal.number;
    switch (left.kind) {
    case Kind::none: return false;
    case Kind::natural:
    case Kind::integer: return number && ordered(op, *number_of(left) <=> *number);
    case Kind::real: // the constant, too, is a number of this encoding
        if (const Encoding &own = type.encoding; number && own.kind == Encoding::Kind::real &&
                                                 own.calibrator.kind == Calibrator::Kind::none &&
                                                 own.contexts.empty()) {
            std::uint64_t word = 0;
            if (const auto bits = bits_of(own, *number); bits && number_of(own, *bits, word)) {
                return ordered(op, *number_of(left) <=> Number(std::bit_cast<double>(word)));
            }
        }
        return number && ordered(op, *number_of(left) <=> *number);
    case Kind::label: {
        const auto named = std::find_if(type.enumerators.begin(), type.enumerators.end(),
                                        [&](const Enumerator &enumerator) { return enumerator.label == literal.text; });
        if (named != type.enumerators.end()) {
            return compare(op, left, operand_of(type, named->low));
        }
        const auto raw = number_of(left);
        return number ? raw && ordered(op, *raw <=> *number)
                      : ordered(op, name_of(left) <=> std::string_view(literal.text));
    }
    case Kind::boolean: {
        const auto is_true = truth(type, literal.text);
        const auto right = is_true ? std::optional<Number>(*is_true) : number;
        return right && ordered(op, Number(left.word) <=> *right);
    }
    case Kind::text: return ordered(op, left.text <=> std::string_view(literal.text));
    case Kind::binary: {
        const auto bytes = bytes_in(literal.text);
        return bytes && ordered(op, order_of_bytes(left.text, *bytes));
    }
    case Kind::time:
    case Kind::duration: {
        const auto ns = time_of(type, trimmed(literal.text));
        const auto right = ns ? std::optional<Number>(*ns) : number ? std::optional(*number * one_second) : number;
        return right && ordered(op, Number(static_cast<std::int64_t>(left.word)) <=> *right);
    }
    }
    return false;
}

bool compare(Operator op, const Operand &left, const Operand &right)
{
    const auto is = [&](Kind kind) { return (left.kind == kind) + (right.kind == kind); };
    if (is(Kind::label) == 2 && op != Operator::equal && op != Operator::unequal) { // in the order of their numbers
        const auto a = place_of(left), b = place_of(right);
        return a && b && ordered(op, *a <=> *b);
    }
    if (is(Kind::text) + is(Kind::label) == 2) {
        return ordered(op, name_of(left) <=> name_of(right));
    }
    if (is(Kind::binary) == 2) {
        return ordered(op, order_of_bytes(left.text, right.text));
    }
    if (right.kind == Kind::text) {
        return compare(op, left, Literal(std::string(right.text)));
    }
    if (left.kind == Kind::text) {
        constexpr Operator turned[] = {Operator::equal,    Operator::unequal, Operator::more,
                                       Operator::at_least, Operator::less,    Operator::at_most};
        return compare(turned[static_cast<int>(op)], right, Literal(std::string(left.text)));
    }
    if (is(Kind::time) == 2 || is(Kind::duration) == 2) {
        return ordered(op, static_cast<std::int64_t>(left.word) <=> static_cast<std::int64_t>(right.word));
    }
    const auto a = number_of(left), b = number_of(right);
    return a && b && ordered(op, *a <=> *b);
}

} // namespace fledge::ground

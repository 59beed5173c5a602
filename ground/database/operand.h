// SPDX-License-Identifier: Apache-2.0
// Values to which conditions and calculations refer. A text, a number, a label and the raw number of one value compare
// alike, in packets that are decoded and in commands that are encoded.
#pragma once

#include "ground/database/numbers.h"

namespace fledge::ground {

struct Operand {
    Kind kind;
    std::uint64_t word;
    const Type *type;
    Kind raw_kind = Kind::none; ///< of a label
    std::uint64_t raw = 0;
    std::string_view text{};         ///< of a text or a binary value
    std::optional<std::size_t> at{}; ///< [bits] in a packet
};

/// A number, a boolean, a time [s], or the raw number of a label.
std::optional<Number> number_of(const Operand &operand);

/// A label or a text as it is written; a number in digits.
std::string shown(const Operand &operand);

/// Whether a boolean's text is true: one of its labels, else true, True, 1 or false, False, 0. Nothing: it is no such.
std::optional<bool> truth(const Type &type, std::string_view text);

/// The bytes of hexadecimal digits, which may begin with 0x.
std::optional<std::string> bytes_in(const std::string &text);

/// The value of a type that a database writes as text, as an initial value; a time without a unit is in seconds. The
/// text must outlive it: a value that the type does not have remains text.
Operand constant(const Type &type, std::string_view text);

/// The value of a type in units, from a number: of a label its raw number, of a time [ns].
Operand operand_of(const Type &type, const Number &number);

/// Whether a value of a type, calibrated or raw, can equal a constant of a condition.
bool has_value(const Type &type, bool calibrated, const Literal &literal);

bool compare(Operator op, const Operand &left, const Literal &literal);
bool compare(Operator op, const Operand &left, const Operand &right);

} // namespace fledge::ground

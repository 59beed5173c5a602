// SPDX-License-Identifier: Apache-2.0
// A number of a database: exact if it is whole, as integers of 64 bits are; else a double.
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace fledge::ground {

__extension__ using Wide = __int128;

class Number {
public:
    Number() = default;
    template <class Value>
    requires std::is_arithmetic_v<Value> || std::is_same_v<Value, Wide>
    constexpr Number(Value value) : is_whole_(!std::is_floating_point_v<Value>)
    {
        if constexpr (std::is_floating_point_v<Value>) {
            real_ = value;
        } else {
            whole_ = value;
        }
    }

    bool is_whole() const { return is_whole_; }
    Wide whole() const { return whole_; } ///< if it is whole
    double real() const { return is_whole_ ? static_cast<double>(whole_) : real_; }
    long double extended() const { return is_whole_ ? static_cast<long double>(whole_) : real_; }

    /// The nearest whole number, away from zero if there are two; nothing: NaN, or beyond 126 bits.
    std::optional<Wide> nearest() const;

    /// Exact, also between whole numbers and doubles.
    std::partial_ordering operator<=>(const Number &other) const;
    bool operator==(const Number &other) const { return (*this <=> other) == 0; }

    /// Exact if both are whole and the result has at most 127 bits.
    Number operator+(const Number &other) const;
    Number operator-(const Number &other) const;
    Number operator*(const Number &other) const;

private:
    Wide whole_ = 0;
    double real_ = 0;
    bool is_whole_ = true;
};

/// A double as a number, which is whole if the double has no fraction and at most 63 bits.
Number exactly(double x);

/// A number as databases and users write it: decimal, 0x1F, 0o17, 0b11, 1.5e3; whole numbers have at most 64 bits.
std::optional<Number> number_in(std::string_view text);

/// A text without the blanks around it.
std::string_view trimmed(std::string_view text);

/// The bytes of hexadecimal digits, of which the first byte may have one; nothing: there are others.
std::optional<std::vector<std::uint8_t>> octets_in(std::string_view digits);

/// The shortest decimal text.
std::string text_of(const Number &number);

} // namespace fledge::ground

// SPDX-License-Identifier: Apache-2.0
#include "ground/database/number.h"

#include <charconv>
#include <cmath>

namespace fledge::ground {

namespace {

constexpr double largest = 0x1p126;

template <class Value> bool parse(std::string_view text, Value &value, int base)
{
    std::from_chars_result done{};
    if constexpr (std::is_integral_v<Value>) {
        done = std::from_chars(text.data(), text.data() + text.size(), value, base);
    } else {
        done = std::from_chars(text.data(), text.data() + text.size(), value);
    }
    return done.ec == std::errc() && done.ptr == text.data() + text.size() && !text.empty();
}

} // namespace

std::optional<Wide> Number::nearest() const
{
    return is_whole_                   ? std::optional(whole_)
           : std::abs(real_) < largest ? std::optional(static_cast<Wide>(std::round(real_)))
                                       : std::nullopt;
}

std::partial_ordering Number::operator<=>(const Number &other) const
{
    if (is_whole_ && other.is_whole_) {
        return whole_ <=> other.whole_;
    }
    if (!is_whole_ && !other.is_whole_) {
        return real_ <=> other.real_;
    }
    if (!is_whole_) {
        return 0 <=> (other <=> *this);
    }
    const double x = other.real_, below = std::floor(x);
    if (!(std::abs(x) < largest)) {
        return 0 <=> x; // beyond all whole numbers, or NaN
    }
    const auto order = whole_ <=> static_cast<Wide>(below);
    return order == 0 && below < x ? std::partial_ordering::less : std::partial_ordering(order);
}

Number Number::operator+(const Number &other) const
{
    Wide sum = 0;
    return is_whole_ && other.is_whole_ && !__builtin_add_overflow(whole_, other.whole_, &sum)
               ? Number(sum)
               : Number(real() + other.real());
}

Number Number::operator-(const Number &other) const
{
    Wide difference = 0;
    return is_whole_ && other.is_whole_ && !__builtin_sub_overflow(whole_, other.whole_, &difference)
               ? Number(difference)
               : Number(real() - other.real());
}

Number Number::operator*(const Number &other) const
{
    Wide product = 0;
    return is_whole_ && other.is_whole_ && !__builtin_mul_overflow(whole_, other.whole_, &product)
               ? Number(product)
               : Number(real() * other.real());
}

Number exactly(double x)
{
    return x == std::trunc(x) && std::abs(x) < 0x1p63 ? Number(static_cast<std::int64_t>(x)) : Number(x);
}

std::string_view trimmed(std::string_view text)
{
    const auto first = text.find_first_not_of(" \t\r\n"), last = text.find_last_not_of(" \t\r\n");
    return first == std::string_view::npos ? "" : text.substr(first, last - first + 1);
}

std::optional<std::vector<std::uint8_t>> octets_in(std::string_view digits)
{
    const std::string whole = (digits.size() % 2 == 0 ? "" : "0") + std::string(digits);
    std::vector<std::uint8_t> bytes(whole.size() / 2);
    for (std::size_t i = 0; i < bytes.size(); i++) {
        const char *const end = &whole[2 * i] + 2;
        if (std::from_chars(&whole[2 * i], end, bytes[i], 16).ptr != end) {
            return std::nullopt;
        }
    }
    return bytes;
}

std::optional<Number> number_in(std::string_view text)
{
    std::string_view digits = trimmed(text);
    const bool negative = digits.starts_with('-');
    if (negative || digits.starts_with('+')) {
        digits.remove_prefix(1);
    }
    int base = 10;
    if (digits.size() > 2 && digits[0] == '0') {
        const char letter = static_cast<char>(digits[1] | 0x20);
        base = letter == 'x' ? 16 : letter == 'o' ? 8 : letter == 'b' ? 2 : 10;
        digits.remove_prefix(base == 10 ? 0 : 2);
    }
    std::uint64_t size = 0;
    std::string_view whole = digits;
    if (const auto point = digits.find('.'); base == 10 && point != std::string_view::npos && !negative &&
                                             digits.find_first_not_of('0', point + 1) == std::string_view::npos) {
        whole = digits.substr(0, point); // a double may have too few digits for 9007199254740993.0; -0.0 keeps its sign
    }
    if (parse(whole, size, base) && (!negative || size <= std::uint64_t(1) << 63)) {
        return negative ? Number(-Wide(size)) : Number(size);
    }
    double real = 0;
    return base == 10 && !digits.starts_with('-') && parse(digits, real, base)
               ? std::optional(Number(negative ? -real : real))
               : std::nullopt;
}

std::string text_of(const Number &number)
{
    if (!number.is_whole() || number.whole() < -(Wide(1) << 63) || number.whole() >= Wide(1) << 64) {
        char text[32];
        return {text, std::to_chars(text, text + sizeof text, number.real()).ptr};
    }
    return number.whole() < 0 ? std::to_string(static_cast<std::int64_t>(number.whole()))
                              : std::to_string(static_cast<std::uint64_t>(number.whole()));
}

} // namespace fledge::ground

// SPDX-License-Identifier: Apache-2.0
#include "ground/database/numbers.h"

#include <algorithm>
#include <cmath>

namespace fledge::ground {

namespace {

constexpr std::uint64_t mask(unsigned bits)
{
    return bits >= 64 ? ~0ull : (1ull << bits) - 1;
}

constexpr std::int64_t extended(std::uint64_t value, unsigned bits)
{
    return static_cast<std::int64_t>(value << (64 - bits)) >> (64 - bits);
}

/// Reorder bits from memory to the value, or back.
std::uint64_t reordered(const Encoding &encoding, std::uint64_t bits, bool to_memory)
{
    const std::size_t n = encoding.byte_order.size();
    if (encoding.bits_reversed && !to_memory) {
        std::uint64_t turned = 0;
        for (unsigned i = 0; i < encoding.bits; i++) {
            turned |= (bits >> i & 1) << (encoding.bits - 1 - i);
        }
        bits = turned;
    }
    if (n != 0) {
        std::uint64_t moved = 0;
        for (std::size_t i = 0; i < n; i++) {
            const std::size_t place = n - 1 - i, significance = encoding.byte_order[i];
            moved |= to_memory ? (bits >> 8 * significance & 0xFF) << 8 * place
                               : (bits >> 8 * place & 0xFF) << 8 * significance;
        }
        bits = moved;
    }
    if (encoding.bits_reversed && to_memory) {
        Encoding turn;
        turn.bits = encoding.bits;
        turn.bits_reversed = true;
        bits = reordered(turn, bits, false);
    }
    return bits;
}

double half(std::uint64_t bits)
{
    const double sign = bits >> 15 ? -1 : 1, fraction = static_cast<double>(bits & 0x3FF);
    const int exponent = static_cast<int>(bits >> 10 & 0x1F);
    return exponent == 31  ? (fraction != 0 ? std::nan("") : sign * std::numeric_limits<double>::infinity())
           : exponent == 0 ? sign * std::ldexp(fraction, -24)
                           : sign * std::ldexp(1024 + fraction, exponent - 25);
}

std::optional<std::uint64_t> half_of(double x)
{
    const std::uint64_t sign = std::signbit(x) ? 0x8000 : 0;
    if (std::isnan(x) || std::isinf(x)) {
        return sign | 0x7C00 | (std::isnan(x) ? 0x200 : 0);
    }
    int exponent = 0;
    std::frexp(x, &exponent);
    const int place = std::max(exponent - 11, -24); // of the last bit
    const double fraction = std::nearbyint(std::ldexp(std::abs(x), -place));
    const std::uint64_t bits = static_cast<std::uint64_t>(fraction) + (static_cast<std::uint64_t>(place + 24) << 10);
    return x == 0 ? std::optional(sign) : bits >= 0x7C00 ? std::nullopt : std::optional(sign | bits);
}

/// A fraction of 24 or 40 bits in two's complement; the exponent's 8 bits stand behind its first 24.
double mil1750a(std::uint64_t bits, unsigned n)
{
    const std::uint64_t fraction = n == 32 ? bits >> 8 : bits >> 24 << 16 | (bits & 0xFFFF);
    const std::uint64_t exponent = n == 32 ? bits & 0xFF : bits >> 16 & 0xFF;
    return std::ldexp(static_cast<double>(extended(fraction, n - 8)),
                      static_cast<int>(extended(exponent, 8)) - static_cast<int>(n - 9));
}

std::optional<std::uint64_t> mil1750a_of(double x, unsigned n)
{
    const int digits = static_cast<int>(n - 9); // behind the sign
    int exponent = 0;
    double fraction = std::nearbyint(std::ldexp(std::frexp(x, &exponent), digits));
    if (fraction == std::ldexp(1, digits)) {
        fraction /= 2;
        exponent++;
    } else if (fraction == -std::ldexp(0.5, digits)) {
        fraction *= 2;
        exponent--;
    }
    if (exponent < -128 && x != 0) { // not normalised
        fraction = std::nearbyint(std::ldexp(x, digits + 128));
        exponent = -128;
    }
    if (!std::isfinite(x) || exponent > 127) {
        return std::nullopt;
    }
    const std::uint64_t f = static_cast<std::uint64_t>(static_cast<std::int64_t>(fraction)) & mask(n - 8);
    const std::uint64_t e = x == 0 ? 0 : static_cast<std::uint64_t>(exponent) & 0xFF;
    return n == 32 ? f << 8 | e : f >> 16 << 24 | e << 16 | (f & 0xFFFF);
}

std::optional<std::uint64_t> whole_bits(const Encoding &encoding, Wide number)
{
    const unsigned n = encoding.bits;
    const Wide half_range = Wide(1) << (n - 1);
    std::uint64_t bits = static_cast<std::uint64_t>(number) & mask(n);
    bool holds = false;
    switch (encoding.form) {
    case NumberForm::plain: holds = number >= 0 && number < 2 * half_range; break;
    case NumberForm::twos_complement: holds = number >= -half_range && number < half_range; break;
    case NumberForm::ones_complement:
    case NumberForm::sign_magnitude:
        holds = number > -half_range && number < half_range;
        if (number < 0) {
            bits = encoding.form == NumberForm::ones_complement
                       ? ~(0 - static_cast<std::uint64_t>(number)) & mask(n)
                       : static_cast<std::uint64_t>(half_range) - static_cast<std::uint64_t>(number);
        }
        break;
    case NumberForm::bcd:
    case NumberForm::packed_bcd: {
        const unsigned step = encoding.form == NumberForm::bcd ? 8 : 4;
        bits = 0;
        Wide left = number;
        for (unsigned i = 0; i < n; i += step, left /= 10) {
            bits |= static_cast<std::uint64_t>(left % 10) << i;
        }
        holds = number >= 0 && left == 0;
        break;
    }
    default: break;
    }
    return holds ? std::optional(bits) : std::nullopt;
}

std::optional<std::uint64_t> real_bits(const Encoding &encoding, double number)
{
    if (encoding.form == NumberForm::mil1750a) {
        return mil1750a_of(number, encoding.bits);
    }
    if (encoding.bits == 64) {
        return std::bit_cast<std::uint64_t>(number);
    }
    if (encoding.bits == 16) {
        return half_of(number);
    }
    const auto single = static_cast<float>(number);
    return !std::isinf(single) || std::isinf(number)
               ? std::optional<std::uint64_t>(std::bit_cast<std::uint32_t>(single))
               : std::nullopt;
}

// The characters of Windows-1252 from 0x80 to 0x9F; 0: none.
constexpr std::uint16_t windows[32] = {0x20AC, 0,      0x201A, 0x0192, 0x201E, 0x2026, 0x2020, 0x2021,
                                       0x02C6, 0x2030, 0x0160, 0x2039, 0x0152, 0,      0x017D, 0,
                                       0,      0x2018, 0x2019, 0x201C, 0x201D, 0x2022, 0x2013, 0x2014,
                                       0x02DC, 0x2122, 0x0161, 0x203A, 0x0153, 0,      0x017E, 0x0178};

void append(std::string &text, std::uint32_t point)
{
    if (point > 0x10FFFF || (point >= 0xD800 && point < 0xE000)) {
        point = 0xFFFD;
    }
    if (point < 0x80) {
        text += static_cast<char>(point);
        return;
    }
    const int more = point < 0x800 ? 1 : point < 0x10000 ? 2 : 3;
    text += static_cast<char>("\xC0\xE0\xF0"[more - 1] | static_cast<char>(point >> 6 * more));
    for (int i = more - 1; i >= 0; i--) {
        text += static_cast<char>(0x80 | (point >> 6 * i & 0x3F));
    }
}

/// The code points of UTF-8; U+FFFD for invalid bytes.
std::vector<std::uint32_t> points_of(std::string_view text)
{
    std::vector<std::uint32_t> points;
    for (std::size_t i = 0; i < text.size();) {
        const auto first = static_cast<std::uint8_t>(text[i++]);
        const int more = first < 0x80 ? 0 : first >> 5 == 6 ? 1 : first >> 4 == 14 ? 2 : first >> 3 == 30 ? 3 : -1;
        std::uint32_t point = more < 0 ? 0xFFFD : more == 0 ? first : first & (0x3F >> more);
        for (int j = 0; j < more; j++) {
            if (i == text.size() || (static_cast<std::uint8_t>(text[i]) & 0xC0) != 0x80) {
                point = 0xFFFD;
                break;
            }
            point = point << 6 | (static_cast<std::uint8_t>(text[i++]) & 0x3F);
        }
        points.push_back(point);
    }
    return points;
}

} // namespace

void store_bits(std::uint8_t *p, std::size_t bit, unsigned bits, std::uint64_t value)
{
    for (unsigned left = bits; left > 0;) { // in each step up to the end of a byte
        const unsigned room = 8 - bit % 8, n = std::min(room, left);
        const std::uint64_t part = value >> (left - n) & mask(n);
        const auto shift = room - n;
        p[bit / 8] = static_cast<std::uint8_t>((p[bit / 8] & ~(mask(n) << shift)) | part << shift);
        bit += n;
        left -= n;
    }
}

Kind raw_kind(const Encoding &encoding)
{
    switch (encoding.kind) {
    case Encoding::Kind::none: return Kind::none;
    case Encoding::Kind::text: return Kind::text;
    case Encoding::Kind::binary: return Kind::binary;
    case Encoding::Kind::real: return Kind::real;
    case Encoding::Kind::integer: break;
    }
    return encoding.form == NumberForm::plain || encoding.form >= NumberForm::bcd ? Kind::natural : Kind::integer;
}

bool number_of(const Encoding &encoding, std::uint64_t bits, std::uint64_t &number)
{
    const unsigned n = encoding.bits;
    if (encoding.bits_reversed || !encoding.byte_order.empty()) {
        bits = reordered(encoding, bits, false);
    }
    number = bits;
    const bool negative = bits >> (n - 1) & 1;
    switch (encoding.form) {
    case NumberForm::plain: break;
    case NumberForm::twos_complement: number = static_cast<std::uint64_t>(extended(bits, n)); break;
    case NumberForm::ones_complement: number = negative ? 0 - (~bits & mask(n)) : bits; break;
    case NumberForm::sign_magnitude: number = negative ? 0 - (bits & mask(n - 1)) : bits; break;
    case NumberForm::bcd:
    case NumberForm::packed_bcd: {
        const unsigned step = encoding.form == NumberForm::bcd ? 8 : 4;
        number = 0;
        for (unsigned i = n; i > 0; i -= step) {
            const std::uint64_t digit = bits >> (i - step) & mask(step);
            if (digit > 9) {
                return false;
            }
            number = 10 * number + digit;
        }
        break;
    }
    case NumberForm::ieee754:
        number = n == 64   ? bits
                 : n == 32 ? std::bit_cast<std::uint64_t>(
                                 static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits))))
                           : std::bit_cast<std::uint64_t>(half(bits));
        break;
    case NumberForm::mil1750a: number = std::bit_cast<std::uint64_t>(mil1750a(bits, n)); break;
    }
    return true;
}

std::optional<std::uint64_t> bits_of(const Encoding &encoding, const Number &number)
{
    std::optional<std::uint64_t> bits;
    if (encoding.form >= NumberForm::ieee754) {
        bits = real_bits(encoding, number.real());
    } else if (const auto whole = number.nearest()) {
        bits = whole_bits(encoding, *whole);
    }
    return bits ? std::optional(reordered(encoding, *bits, true)) : std::nullopt;
}

std::size_t unit_of(Charset charset)
{
    return charset < Charset::utf16 ? 1 : charset < Charset::utf32 ? 2 : 4;
}

std::string utf8(Charset charset, std::span<const std::uint8_t> bytes)
{
    std::string text;
    const std::size_t unit = unit_of(charset);
    if (charset == Charset::utf8) {
        text.assign(bytes.begin(), bytes.end());
        return text;
    }
    bool little = charset == Charset::utf16le || charset == Charset::utf32le;
    const bool marked = charset == Charset::utf16 || charset == Charset::utf32; // by a byte order mark
    const auto at = [&](std::size_t i) {
        std::uint32_t point = 0;
        for (std::size_t j = 0; j < unit; j++) {
            point = point << 8 | bytes[i + (little ? unit - 1 - j : j)];
        }
        return point;
    };
    for (std::size_t i = 0; i + unit <= bytes.size(); i += unit) {
        std::uint32_t point = at(i);
        if (marked && i == 0 && (point == 0xFEFF || point == (unit == 2 ? 0xFFFEu : 0xFFFE0000u))) {
            little = point != 0xFEFF;
            continue;
        }
        if (unit == 2 && point >> 10 == 0x36 && i + 4 <= bytes.size() && at(i + 2) >> 10 == 0x37) {
            i += 2;
            point = 0x10000 + ((point & 0x3FF) << 10 | (at(i) & 0x3FF));
        } else if (charset == Charset::ascii && point >= 0x80) {
            point = 0xFFFD;
        } else if (charset == Charset::windows1252 && point >= 0x80 && point < 0xA0) {
            point = windows[point - 0x80] != 0 ? windows[point - 0x80] : 0xFFFD;
        }
        append(text, point);
    }
    if (bytes.size() % unit != 0) {
        append(text, 0xFFFD);
    }
    return text;
}

std::optional<std::vector<std::uint8_t>> characters(Charset charset, std::string_view text)
{
    std::vector<std::uint8_t> bytes;
    if (charset == Charset::utf8) {
        bytes.assign(text.begin(), text.end());
        return bytes;
    }
    const std::size_t unit = unit_of(charset);
    const bool little = charset == Charset::utf16le || charset == Charset::utf32le;
    const auto put = [&](std::uint32_t point) {
        for (std::size_t j = 0; j < unit; j++) {
            bytes.push_back(static_cast<std::uint8_t>(point >> 8 * (little ? j : unit - 1 - j)));
        }
    };
    if (charset == Charset::utf16 || charset == Charset::utf32) {
        put(0xFEFF);
    }
    for (std::uint32_t point : points_of(text)) {
        if (charset == Charset::windows1252 && (point >= 0x100 || (point >= 0x80 && point < 0xA0))) {
            const auto found = std::find(std::begin(windows), std::end(windows), point);
            if (found == std::end(windows)) {
                return std::nullopt;
            }
            point = static_cast<std::uint32_t>(0x80 + (found - std::begin(windows)));
        }
        if (unit == 1 && point >= (charset == Charset::ascii ? 0x80u : 0x100u)) {
            return std::nullopt;
        }
        if (unit == 2 && point >= 0x10000) {
            put(0xD800 | (point - 0x10000) >> 10);
            point = 0xDC00 | (point & 0x3FF);
        }
        put(point);
    }
    return bytes;
}

} // namespace fledge::ground

// SPDX-License-Identifier: Apache-2.0
// Bits in packets as numbers and texts, and back.
#pragma once

#include "ground/database/model.h"

#include <bit>
#include <cstring>
#include <span>
#include <string_view>

namespace fledge::ground {

/// The meaning of a value's 64 bits.
enum class Kind : std::uint8_t {
    none,
    natural, ///< without a sign
    integer,
    real,
    label,   ///< the place of an enumerator in its type; no_id: none has this value
    boolean, ///< 0 or 1
    text,    ///< UTF-8, a slice of bytes
    binary,  ///< a slice of bytes, whose last bit is the value's last bit
    time,    ///< [ns] since 1970-01-01T00:00:00 UTC (times.h)
    duration ///< [ns]
};

/// Whether a value is in ns.
constexpr bool is_time(Kind kind)
{
    return kind == Kind::time || kind == Kind::duration;
}

/// A range of bytes: the place in the upper 32 bits, the number in the lower 32.
constexpr std::uint64_t slice(std::size_t at, std::size_t n)
{
    return static_cast<std::uint64_t>(at) << 32 | static_cast<std::uint32_t>(n);
}

/// The 8 bytes from p on, most significant first.
inline std::uint64_t load64(const std::uint8_t *p)
{
    std::uint64_t word;
    std::memcpy(&word, p, 8);
    return std::endian::native == std::endian::little ? __builtin_bswap64(word) : word;
}

/// `bits` bits, 1 to 64, from a bit on; up to 9 bytes from there must be readable.
inline std::uint64_t load_bits(const std::uint8_t *p, std::size_t bit, unsigned bits)
{
    const std::uint8_t *const from = p + bit / 8;
    const unsigned shift = bit % 8;
    std::uint64_t word = load64(from) << shift;
    if (shift + bits > 64) {
        word |= from[8] >> (8 - shift);
    }
    return word >> (64 - bits);
}

/// Write `bits` bits, 1 to 64, at a bit; the bytes must exist.
void store_bits(std::uint8_t *p, std::size_t bit, unsigned bits, std::uint64_t value);

/// A number, a boolean, a time or a duration [s] as a real number; nothing: it is none of these.
inline std::optional<double> real_of(Kind kind, std::uint64_t word)
{
    switch (kind) {
    case Kind::natural:
    case Kind::boolean: return static_cast<double>(word);
    case Kind::integer: return static_cast<double>(static_cast<std::int64_t>(word));
    case Kind::time:
    case Kind::duration: return static_cast<double>(static_cast<std::int64_t>(word)) / 1e9;
    case Kind::real: return std::bit_cast<double>(word);
    default: return std::nullopt;
    }
}

/// The same as a number, which is exact if it is whole.
inline std::optional<Number> number_of(Kind kind, std::uint64_t word)
{
    if (kind == Kind::natural || kind == Kind::boolean) {
        return word;
    }
    if (kind == Kind::integer) {
        return static_cast<std::int64_t>(word);
    }
    const auto real = real_of(kind, word);
    return real ? std::optional<Number>(*real) : std::nullopt;
}

/// The 64 bits of a whole number of a kind, natural or integer. Nothing: they cannot hold it.
inline std::optional<std::uint64_t> word_of(Kind kind, const Number &number)
{
    const auto whole = number.nearest();
    const bool holds = whole && (kind == Kind::natural ? *whole == static_cast<std::uint64_t>(*whole)
                                                       : *whole == static_cast<std::int64_t>(*whole));
    return holds ? std::optional(static_cast<std::uint64_t>(*whole)) : std::nullopt;
}

/// The kind of a number as it lies in a packet.
Kind raw_kind(const Encoding &encoding);

/// A number from its bits, in the 64 bits of raw_kind. False: a BCD digit is beyond 9.
bool number_of(const Encoding &encoding, std::uint64_t bits, std::uint64_t &number);

/// The bits of a number, which is rounded if the encoding is whole. Nothing: the encoding cannot hold it.
std::optional<std::uint64_t> bits_of(const Encoding &encoding, const Number &number);

/// Text from a character set to UTF-8, and back. Invalid bytes become U+FFFD; nothing: the set lacks a character.
std::string utf8(Charset charset, std::span<const std::uint8_t> bytes);
std::optional<std::vector<std::uint8_t>> characters(Charset charset, std::string_view utf8);
/// [bytes] of a character set's unit.
std::size_t unit_of(Charset charset);

/// The nearest whole number, clamped to the range; 0 for NaN.
inline std::int64_t nearest(double x)
{
    constexpr double limit = 9223372036854775808.0;
    return x >= limit    ? std::numeric_limits<std::int64_t>::max()
           : x <= -limit ? std::numeric_limits<std::int64_t>::min()
           : x != x      ? 0
                         : __builtin_llround(x);
}

} // namespace fledge::ground

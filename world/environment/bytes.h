// SPDX-License-Identifier: Apache-2.0
// Numbers from the bytes of a file, in either byte order.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace fledge::world {

inline std::uint32_t reversed(std::uint32_t x)
{
    return __builtin_bswap32(x);
}
inline std::uint64_t reversed(std::uint64_t x)
{
    return __builtin_bswap64(x);
}

/// The number of type T (of 4 or 8 bytes) at `bytes`, which need not be aligned.
template <typename T> T load(const void *bytes, std::endian order)
{
    static_assert(sizeof(T) == 4 || sizeof(T) == 8);
    using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
    Bits bits;
    std::memcpy(&bits, bytes, sizeof bits);
    return std::bit_cast<T>(order == std::endian::native ? bits : reversed(bits));
}

} // namespace fledge::world

// SPDX-License-Identifier: Apache-2.0
#include "emulator/bus/edac.h"

#include <array>
#include <bit>

namespace fledge::emulator {

namespace {

/// The columns of the data bits: the first 32 of the 35 numbers of seven bits that have three ones.
constexpr auto columns = [] {
    std::array<std::uint8_t, 32> c{};
    unsigned n = 0;
    for (unsigned v = 0; n < c.size(); v++) {
        if (std::popcount(v) == 3) {
            c[n++] = static_cast<std::uint8_t>(v);
        }
    }
    return c;
}();

} // namespace

EdacResult edac_decode(EdacFlips flips, std::uint32_t &data)
{
    std::uint32_t syndrome = flips.check;
    for (unsigned bit = 0; bit < 32; bit++) {
        syndrome ^= flips.data >> bit & 1 ? columns[bit] : 0u;
    }
    data = 0;
    if (syndrome == 0) {
        return EdacResult::clean;
    }
    if (std::has_single_bit(syndrome)) {
        return EdacResult::corrected;
    }
    for (unsigned bit = 0; bit < 32; bit++) {
        if (columns[bit] == syndrome) {
            data = 1u << bit;
            return EdacResult::corrected;
        }
    }
    return EdacResult::uncorrectable;
}

} // namespace fledge::emulator

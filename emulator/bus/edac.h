// SPDX-License-Identifier: Apache-2.0
// Single error correction, double error detection: a (39,32) code after Hsiao. Each of the 32 data bits has a column of
// three of the seven check bits, each check bit one of its own. The code is linear, so what a reader finds depends on
// the flipped bits alone: memory keeps no check bits, only the flips.
#pragma once

#include <cstdint>

namespace fledge::emulator {

struct EdacFlips {
    std::uint32_t data = 0;  ///< of the word
    std::uint32_t check = 0; ///< of its seven check bits
    bool none() const { return data == 0 && check == 0; }
};

enum class EdacResult : std::uint8_t {
    clean,        ///< no error, or one that looks like another valid word
    corrected,    ///< one bit was flipped, or three that look like one
    uncorrectable ///< two bits, or three that do not look like one
};

/// What the decoder finds; `data` are the bits that it inverts.
EdacResult edac_decode(EdacFlips flips, std::uint32_t &data);

} // namespace fledge::emulator

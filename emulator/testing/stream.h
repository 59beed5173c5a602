// SPDX-License-Identifier: Apache-2.0
// A program of many random blocks, as an image of memory that runs on any LEON3. Each block starts from its own random
// registers and leaves in memory all that it computed: registers, PSR, Y, WIM, FSR, and the traps that it took. So two
// processors agree if their memories are equal when the program has ended.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emulator/testing/small_computer.h"

namespace fledge::emulator::testing {

/// What blocks may contain besides what all processors do alike.
struct StreamOptions {
    std::uint64_t seed = 1;
    std::uint32_t blocks = 500;
    std::uint32_t loop = 4; ///< how often the body of a loop runs, at most
    bool sleep = false;     ///< blocks that wait for an interrupt
    bool for_qemu = true;   ///< without what stock QEMU does otherwise: README.md has the list
};

/// What a block left behind, or was given; all in 32-bit words of the machine.
struct Record {
    std::uint32_t psr, pc, npc, wim, y, fsr;
    std::uint32_t floats[32];
    std::uint32_t windows[8][16]; ///< locals and ins of each
    std::uint32_t globals[8];     ///< from %g1 on; the last is not used
};

struct TrapEntry {
    std::uint32_t tbr, pc, npc, psr, wim, fsr, unused[2];
};

struct Block {
    Record given; ///< pc is its first instruction
    Record left;
    std::uint32_t trap_count;
    std::uint32_t unused;
    TrapEntry traps[16]; ///< the last ones
    std::uint32_t padding[34];
};
static_assert(sizeof(Block) == 2048);

inline constexpr std::uint32_t blocks_base = ram_base + 0x10000;

struct Stream {
    std::uint32_t entry = 0;
    std::uint32_t size = 0;           ///< of RAM [bytes]
    std::vector<std::uint8_t> image;  ///< from ram_base on, big-endian
    std::vector<std::uint32_t> first; ///< the address of each block's code, and the end of the last
    std::uint32_t data = 0;           ///< of the first block; each has data_size bytes
};
inline constexpr std::uint32_t data_size = 512;

Stream make_stream(const StreamOptions &options);

/// The first difference of two memories after the program, in words for a person; empty if they are equal.
std::string compare(const Stream &stream, const std::vector<std::uint8_t> &expected,
                    const std::vector<std::uint8_t> &found);

} // namespace fledge::emulator::testing

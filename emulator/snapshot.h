// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "emulator/bus/system_bus.h"
#include "emulator/cpu/state.h"

namespace fledge::emulator {

/// What a reset starts.
struct BootImage {
    struct Segment {
        std::uint32_t address = 0;
        std::vector<std::byte> bytes;
        bool operator==(const Segment &) const = default;
    };
    std::uint32_t entry = 0;
    std::vector<Segment> segments; ///< copied into RAM
    bool operator==(const BootImage &) const = default;
};

class Snapshot : public std::enable_shared_from_this<Snapshot> {
public:
    using Page = std::array<std::byte, page_size>;

    std::uint64_t board = 0; ///< the hash of its file
    CpuState cpu;
    std::uint64_t resets = 0;
    std::vector<std::vector<std::byte>> devices;    ///< the state of each
    std::map<std::uint32_t, EdacFlips> flips;       ///< in RAM
    std::vector<std::shared_ptr<const Page>> pages; ///< of all memories; nullptr: all 0
    std::shared_ptr<const BootImage> boot;          ///< nullptr: no program was loaded

    std::vector<std::byte> write() const;
    /// What the file has of its content.
    static std::uint64_t hash_of(std::span<const std::byte> bytes);
    /// Throws Error if the bytes are damaged or of another version or board.
    static std::shared_ptr<const Snapshot> read(std::span<const std::byte> bytes, std::uint64_t board);
};

} // namespace fledge::emulator

// SPDX-License-Identifier: Apache-2.0
// A program for the machine: an ELF file with 32 bits, big-endian, for SPARC; S-records; or the bytes of a PROM, *.bin.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/error.h"

namespace fledge::emulator {

class Program {
public:
    struct Segment {
        std::uint32_t address = 0;     ///< where it is loaded (the physical address)
        std::uint32_t memory_size = 0; ///< bytes; zeros follow those of the file
        std::vector<std::byte> bytes;
    };
    struct Symbol {
        std::string name;
        std::uint32_t address = 0, size = 0;
        bool function = false;
    };

    /// Both throw Error with the name of the file, what is wrong with it, and what is needed.
    static Program read(const std::string &path);
    Program(std::span<const std::byte> file, std::string path);

    const std::string &path() const { return path_; }
    std::uint32_t entry() const { return entry_; }
    const std::vector<Segment> &segments() const { return segments_; }
    /// Functions and objects, by address.
    const std::vector<Symbol> &symbols() const { return symbols_; }
    /// The symbol that an address belongs to; nullptr: none.
    const Symbol *at(std::uint32_t address) const;
    const Symbol *named(std::string_view name) const;
    /// "mrp_feedback_update+0x1c", or "" without a symbol.
    std::string place(std::uint32_t address) const;

private:
    void read_elf(std::span<const std::byte> file);
    void read_records(std::string_view text);

    std::string path_;
    std::uint32_t entry_ = 0;
    std::vector<Segment> segments_;
    std::vector<Symbol> symbols_;
};

} // namespace fledge::emulator

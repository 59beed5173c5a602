// SPDX-License-Identifier: Apache-2.0
// The lines of the source of each instruction, from the debugging information of an ELF file (libdw).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace fledge::emulator {

class SourceLines {
public:
    /// Without debugging information there are no lines. Throws Error if the file cannot be read.
    explicit SourceLines(const std::string &elf);

    struct Range {
        std::uint32_t begin, end; ///< addresses
        std::uint32_t file, line; ///< file: its index in files()
    };
    /// Where a line begins. Several may begin at one address, when their instructions are those of what they call.
    struct Beginning {
        std::uint32_t address, file, line;
    };

    const std::vector<std::string> &files() const { return files_; }
    const std::vector<Beginning> &beginnings() const { return beginnings_; }
    const Range *find(std::uint32_t address) const; ///< or null

private:
    std::vector<std::string> files_;
    std::vector<Range> ranges_; ///< in the order of addresses
    std::vector<Beginning> beginnings_;
};

} // namespace fledge::emulator

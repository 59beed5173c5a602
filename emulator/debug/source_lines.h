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

    const std::vector<std::string> &files() const { return files_; }
    const std::vector<Range> &ranges() const { return ranges_; } ///< in the order of addresses
    const Range *find(std::uint32_t address) const;              ///< or null

private:
    std::vector<std::string> files_;
    std::vector<Range> ranges_;
};

} // namespace fledge::emulator

// SPDX-License-Identifier: Apache-2.0
// How often each instruction ran, and each conditional branch was taken or not: coverage of lines and branches without
// instrumentation.
#pragma once

#include <unordered_map>

#include "emulator/debug/observer.h"
#include "emulator/debug/source_lines.h"
#include "emulator/elf.h"

namespace fledge::emulator {

class Coverage final : public Observer {
public:
    void executed(const Executed &step) override;

    /// Write it for genhtml, in lcov's format, of the source files that are there. Throws Error if that fails.
    void write(const std::string &path, const Program &program, const SourceLines &lines) const;

private:
    struct Counts {
        std::uint64_t executed = 0, taken = 0;
    };
    std::unordered_map<std::uint32_t, Counts> counts_;
};

} // namespace fledge::emulator

// SPDX-License-Identifier: Apache-2.0
// Writes each instruction in words: cycles, address, symbol, disassembly, effective address, result.
#pragma once

#include <cstdio>

#include "emulator/debug/observer.h"
#include "emulator/elf.h"

namespace fledge::emulator {

/// The instruction as an assembler writes it.
std::string disassemble(std::uint32_t address, std::uint32_t word);

class Trace final : public Observer {
public:
    /// Throws Error if the file cannot be written. It traces from a time [cycles] on, and before another one.
    Trace(const std::string &path, const Program &program, std::uint64_t from, std::uint64_t until);
    ~Trace() override;

    void executed(const Executed &step) override;

private:
    const Program &program_;
    std::FILE *file_;
    std::uint64_t from_, until_;
};

} // namespace fledge::emulator

// SPDX-License-Identifier: Apache-2.0
// What the processor was doing, for a person.
#pragma once

#include <string>
#include <vector>

#include "emulator/cpu/engine.h"

namespace fledge::emulator {

class Machine;
class Program;

struct Frame {
    std::uint32_t pc = 0; ///< of the instruction, or of the call
    std::uint32_t sp = 0;
};

/// The calls that led to pc, innermost first, through register windows and saved frames. With a program it also finds
/// the caller of a function that has no window of its own.
std::vector<Frame> backtrace(const Machine &machine, const Program *program);

/// PC, symbol, trap, registers and backtrace.
std::string describe(const Machine &machine, const Core &core, const Program *program);

/// The name of a trap: "illegal_instruction (0x02)".
std::string trap_name(std::uint32_t type);

} // namespace fledge::emulator

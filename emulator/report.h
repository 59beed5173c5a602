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

/// The registers of a device that a debugger may read.
struct DeviceWords {
    struct Word {
        std::string name;
        std::uint32_t address = 0, value = 0;
    };
    std::string name; ///< of the device
    std::vector<Word> words;
};
std::vector<DeviceWords> device_words(const Machine &machine);

/// PC, symbol, trap, registers and backtrace.
std::string describe(const Machine &machine, const Core &core, const Program *program);

/// Whether the program has ended by itself, which is `ta 0` with traps disabled: its status is in %o0, or is that of
/// exit() under RTEMS. `why` says in words why else it has ended: a trap without a handler, a fatal error of RTEMS.
bool program_ended(const Machine &machine, const Program *program, int &status, std::string &why);

/// The name of a trap: "illegal_instruction (0x02)".
std::string trap_name(std::uint32_t type);

} // namespace fledge::emulator

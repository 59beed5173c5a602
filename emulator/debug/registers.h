// SPDX-License-Identifier: Apache-2.0
// The registers of the present window by number, in gdb's order for sparc: globals, outs, locals, ins, f0 to f31, then
// y, psr, wim, tbr, pc, npc, fsr, and one that a LEON3 does not have.
#pragma once

#include <string>
#include <string_view>

#include "emulator/cpu/state.h"

namespace fledge::emulator {

inline constexpr unsigned register_count = 72;
inline constexpr unsigned named_registers = register_count - 1; ///< but the coprocessor's, which a LEON3 does not have

std::string register_name(unsigned number); ///< "l3", without %
/// By "l3", "%l3", "%sp", "%psr", ...; throws Error.
unsigned register_number(std::string_view name);

std::uint32_t get_register(const CpuState &state, unsigned number);
void set_register(CpuState &state, unsigned number, std::uint32_t value); ///< %g0 stays 0

/// Invert a bit, 0 (the lowest) to 31, of a register by its name, or of a word of the windows: "window 17". Throws
/// Error.
void flip_register(CpuState &state, std::string_view name, unsigned bit);

} // namespace fledge::emulator

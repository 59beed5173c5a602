// SPDX-License-Identifier: Apache-2.0
// One step of the reference: what the plain interpreter repeats, and what the fast engines call for the instructions
// that are rare.
#pragma once

#include <cstdint>

#include "emulator/cpu/engine.h"
#include "emulator/cpu/instruction.h"

namespace fledge::emulator {

/// Trap types of SPARC V8, and those that the LEON3 adds.
namespace trap {
inline constexpr std::uint32_t none = 0; ///< 0 is the reset, which no instruction causes
inline constexpr std::uint32_t instruction_access_exception = 0x01, illegal_instruction = 0x02;
inline constexpr std::uint32_t privileged_instruction = 0x03, fp_disabled = 0x04, window_overflow = 0x05;
inline constexpr std::uint32_t window_underflow = 0x06, mem_address_not_aligned = 0x07, fp_exception = 0x08;
inline constexpr std::uint32_t data_access_exception = 0x09, tag_overflow = 0x0A, interrupt = 0x10; ///< plus its level
inline constexpr std::uint32_t cp_disabled = 0x24, division_by_zero = 0x2A, data_store_error = 0x2B;
inline constexpr std::uint32_t instruction = 0x80; ///< plus the number of ticc
} // namespace trap

/// Execute an instruction that stands at pc, or take its trap. Adds its cycles. It neither takes an interrupt nor looks
/// at breakpoints.
/// True: it made an access that a debugger watches.
bool execute(Core &core, const Instruction &instruction);

/// The same with the instruction in memory at pc; a trap if none can be read there.
bool fetch_and_execute(Core &core);

/// What an engine does at a boundary of instructions before it executes one, in this order; `watched` is of the step
/// before. An interrupt is a step of its own: then it returns Boundary::stepped, and the next boundary follows.
///   1. the error mode, 2. a watched access of the step before, 3. Core::attention, which it clears, 4. power-down
///   without an interrupt, 5. the time, 6. an interrupt, 7. a breakpoint, unless the engine steps over it.
enum class Boundary : std::uint8_t { execute, stepped, exit };
Boundary at_boundary(Core &core, std::uint64_t until, bool watched, bool step_over, Exit &exit);

/// Where an instruction of memory reads or writes; of others without meaning.
std::uint32_t effective_address(const CpuState &state, const Instruction &instruction);

} // namespace fledge::emulator

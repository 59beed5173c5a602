// SPDX-License-Identifier: Apache-2.0
// What each step of the processor costs in cycles of its clock. The cost depends on the operation alone, so that a
// block's cost is known when it is decoded.
//
// What counts, in every engine:
// - An executed instruction adds 1 to CpuState::instructions and cycles[op] to CpuState::cycles.
// - A branch that annuls its delay slot costs `annulled` more. The annulled instruction is no step of its own: it is
//   neither fetched, nor counted, nor can an interrupt come between it and the branch.
// - An instruction that traps is not executed: it adds nothing itself. The trap adds `trap` cycles and 1 to
//   CpuState::traps, as an interrupt does. ticc that traps is such an instruction; ticc that does not trap is executed.
// - The write to %asr19 that begins the power-down is executed. Waiting adds nothing: the machine moves
//   CpuState::cycles forward to the next event.
#pragma once

#include <array>
#include <cstdint>

#include "emulator/cpu/instruction.h"

namespace fledge::emulator {

struct Timing {
    std::array<std::uint8_t, op_count> cycles{}; ///< each at least 1
    std::uint8_t trap = 1;                       ///< at least 1
    std::uint8_t annulled = 0;

    std::uint8_t operator[](Op op) const { return cycles[static_cast<std::size_t>(op)]; }
};

/// 1 cycle for each instruction and trap: cycles = instructions + traps, as long as no time is skipped.
Timing plain_timing();

/// The LEON3's pipeline with the GRFPU, as their data sheets say, with hits in the caches. An operation of the GRFPU
/// costs its latency, as if the next instruction needed its result.
Timing leon3_timing();

} // namespace fledge::emulator

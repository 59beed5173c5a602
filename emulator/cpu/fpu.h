// SPDX-License-Identifier: Apache-2.0
// The floating-point unit of the reference.
#pragma once

#include <cstdint>

#include "emulator/cpu/engine.h"
#include "emulator/cpu/instruction.h"

namespace fledge::emulator {

/// Execute a floating-point operation, without pc and cycles. Returns the trap type fp_exception with the reason in
/// fsr.ftt, or trap::none; the interpreter defers the trap of a GRFPU.
std::uint32_t execute_fpop(CpuState &s, FpuPersonality fpu, const Instruction &i);

/// stdfq with an empty queue: a sequence error.
std::uint32_t no_queue(CpuState &s);

/// The field ver of the FSR, in its place.
std::uint32_t fsr_version(FpuPersonality fpu);

} // namespace fledge::emulator

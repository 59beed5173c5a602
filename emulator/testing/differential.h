// SPDX-License-Identifier: Apache-2.0
// The engines side by side: they execute the same program in slices of random lengths, and after each slice their
// states must be the same. Behind the first difference, the instruction is searched that made it.
#pragma once

#include <string>

#include "emulator/cpu/engine.h"
#include "emulator/testing/differences.h"
#include "emulator/testing/stream.h"

namespace fledge::emulator::testing {

/// Run the stream on all engines. Returns what differs, for a person, or "". `memory` receives what the program left.
std::string compare_engines(const Stream &stream, FpuPersonality fpu, std::uint64_t seed,
                            std::vector<std::uint8_t> *memory = nullptr);

/// Three programs of a seed: as stock QEMU computes, with `qemu` also in QEMU; as a GRFPU computes; and with what stock
/// QEMU does not know, or does otherwise.
/// Returns what differs, or "".
std::string compare_seed(std::uint64_t seed, std::uint32_t blocks, bool qemu);

} // namespace fledge::emulator::testing

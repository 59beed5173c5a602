// SPDX-License-Identifier: Apache-2.0
// Stock QEMU as an independent LEON3.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "emulator/testing/stream.h"

namespace fledge::emulator::testing {

/// Why QEMU cannot be compared here; empty: it can. From version 9 on it keeps FSR and propagates NaN otherwise than
/// version 7.2, which FpuPersonality::qemu follows.
std::string without_qemu();

/// The memory after QEMU has executed the program. Throws std::runtime_error if it does not end.
std::vector<std::uint8_t> run_in_qemu(const Stream &stream);

} // namespace fledge::emulator::testing

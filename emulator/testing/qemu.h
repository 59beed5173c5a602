// SPDX-License-Identifier: Apache-2.0
// Stock QEMU as an independent LEON3.
#pragma once

#include <cstdint>
#include <vector>

#include "emulator/testing/stream.h"

namespace fledge::emulator::testing {

/// Whether qemu-system-sparc is installed.
bool has_qemu();

/// The memory after QEMU has executed the program. Throws std::runtime_error if it does not end.
std::vector<std::uint8_t> run_in_qemu(const Stream &stream);

} // namespace fledge::emulator::testing

// SPDX-License-Identifier: Apache-2.0
// A board of 1 MHz, so that a cycle is a microsecond, with every kind of device.
#pragma once

#include <string>

#include "emulator/board.h"

namespace fledge::emulator::testing {

inline const std::string board_text = R"(name = "test"
clock = 1_000_000
[ram]
base = 0x40000000
size = 0x10000
edac = true
[rom]
base = 0
size = 0x2000
[[device]]
kind = "irqmp"
address = 0x80000200
[[device]]
kind = "gptimer"
address = 0x80000300
interrupt = 6
timers = 3
watchdog = 0
[[device]]
kind = "apbuart"
address = 0x80000100
interrupt = 3
[[device]]
kind = "ftmctrl"
address = 0x80000000
[[device]]
kind = "ahbstat"
address = 0x80000F00
interrupt = 1
[[device]]
kind = "scrubber"
address = 0x80000D00
[[device]]
kind = "protection"
address = 0x80000E00
[[device]]
kind = "registers"
address = 0xA0000000
tick = 10
interrupt = 11
)";

inline BoardDescription test_board()
{
    return BoardDescription::parse(board_text, "test.toml");
}

} // namespace fledge::emulator::testing

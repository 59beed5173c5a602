// SPDX-License-Identifier: Apache-2.0
// Two boards without lanes: `clock` has the clock, at 0, and four lines; `other` two lines.
#pragma once

#include "registers/clock.h"

namespace fledge::emulator::testing {

inline constexpr std::uint32_t other_board_at = 128; ///< on the bus

inline constexpr RegisterBoard clock_board = {.name = "clock",
                                              .hash = 1,
                                              .base = 0,
                                              .size = 104,
                                              .big_endian = 1,
                                              .clock = 0,
                                              .clock_interrupt = 0,
                                              .interrupts = 32,
                                              .n_interrupts = 4,
                                              .level = 0,
                                              .n_lanes = 0,
                                              .lanes = nullptr,
                                              .slave = nullptr};
inline constexpr RegisterBoard other_board = {.name = "other",
                                              .hash = 2,
                                              .base = other_board_at,
                                              .size = 64,
                                              .big_endian = 1,
                                              .clock = REGISTER_NOWHERE,
                                              .clock_interrupt = -1,
                                              .interrupts = 0,
                                              .n_interrupts = 2,
                                              .level = 0,
                                              .n_lanes = 0,
                                              .lanes = nullptr,
                                              .slave = nullptr};
inline constexpr const RegisterBoard *boards[] = {&clock_board, &other_board};

} // namespace fledge::emulator::testing

/* SPDX-License-Identifier: Apache-2.0 */
/* The boards of a mission in the register space of a LEON3 board. */
#ifndef TARGETS_LEON3_WINDOWS_H
#define TARGETS_LEON3_WINDOWS_H

#include "registers/plug_and_play.h"
#include "targets/leon3/leon3.h"
#include "targets/mission_io.h"

/** Place a window on each board, at the distance of its base from leon3.registers. windows: io->n_boards of them. */
static inline void leon3_place_windows(const MissionIo *io, RegisterWindow *windows)
{
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        const uint64_t at = leon3.registers + register_bus_offset(io->boards, io->n_boards, io->boards[i]);
        windows[i] = register_window(io->boards[i], (volatile uint32_t *)(uintptr_t)at);
    }
}

static inline void leon3_board_interrupt(void)
{
    leon3.heard++;
}

/** Take the interrupts of boards that have a level. They wake the processor, which reads the lanes at the next tick. */
static inline void leon3_hear_boards(const MissionIo *io)
{
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        const uint32_t level = io->boards[i]->level;
        if (level != 0u && level != leon3.registers_line && level != leon3.timer_line) {
            leon3_on_interrupt(level, leon3_board_interrupt);
        }
    }
}

#endif

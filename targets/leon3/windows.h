/* SPDX-License-Identifier: Apache-2.0 */
/* The boards of a mission in the register space of a LEON3 board. */
#ifndef TARGETS_LEON3_WINDOWS_H
#define TARGETS_LEON3_WINDOWS_H

#include "registers/plug_and_play.h"
#include "targets/leon3/leon3.h"
#include "targets/mission_io.h"

/** Place a window on each board, one behind the other from leon3.registers. windows: io->n_boards of them. */
static inline void leon3_place_windows(const MissionIo *io, RegisterWindow *windows)
{
    uint32_t at = leon3.registers;
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        windows[i] = register_window(io->boards[i], (volatile uint32_t *)(uintptr_t)at);
        at += (io->boards[i]->size + REGISTER_BUS_ALIGNMENT - 1u) / REGISTER_BUS_ALIGNMENT * REGISTER_BUS_ALIGNMENT;
    }
}

#endif

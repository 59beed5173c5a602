/* SPDX-License-Identifier: Apache-2.0 */
/* How a processor finds the register space: the entry of an AHB slave in the plug-and-play table of its bus. The boards
 * lie there at the distances of their bases; the lowest base is the address of the space. The interrupt of the entry is
 * that of a tick. */
#ifndef REGISTERS_PLUG_AND_PLAY_H
#define REGISTERS_PLUG_AND_PLAY_H

#include "registers/board.h"

enum {
    REGISTER_BUS_VENDOR = 0xF1, ///< free for private use
    REGISTER_BUS_DEVICE = 0x001
};

/** [bytes] From the address of the space to a board, which is one of the n. */
static inline uint64_t register_bus_offset(const RegisterBoard *const *boards, uint32_t n, const RegisterBoard *board)
{
    uint64_t lowest = board->base;
    for (uint32_t i = 0u; i < n; i++) {
        lowest = boards[i]->base < lowest ? boards[i]->base : lowest;
    }
    return board->base - lowest;
}

#endif

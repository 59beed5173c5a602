/* SPDX-License-Identifier: Apache-2.0 */
/* How a processor finds the register space: the entry of an AHB slave in the plug-and-play table of its bus. The boards
 * lie there one behind the other, each from a multiple of 64 bytes, as in a register file (shared_file.h). The
 * interrupt of the entry is that of a tick. */
#ifndef REGISTERS_PLUG_AND_PLAY_H
#define REGISTERS_PLUG_AND_PLAY_H

enum {
    REGISTER_BUS_VENDOR = 0xF1, ///< free for private use
    REGISTER_BUS_DEVICE = 0x001,
    REGISTER_BUS_ALIGNMENT = 64 ///< [bytes] of the beginning of a board
};

#endif

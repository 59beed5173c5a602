/* SPDX-License-Identifier: Apache-2.0 */
/* The memory of a board's program, from its linker script: symbols of these names let figures.c measure it. */
#ifndef TARGETS_BARE_MEMORY_H
#define TARGETS_BARE_MEMORY_H

#include <stddef.h>
#include <stdint.h>

#define BARE_PAINT 0x5ac3a53cu /* each word of a stack that was never used */

extern uint8_t board_code[], board_code_end[]; ///< code and constants
extern uint8_t board_data_load[];              ///< the initial values of data: what a reset begins with
extern uint8_t board_ram[];                    ///< what is used of the RAM begins here
extern uint8_t board_data[], board_data_end[]; ///< data with initial values; what is zero at the start follows
extern uint8_t board_bss_end[];                ///< and ends here
extern uint8_t board_kept[];                   ///< up to board_guard: for board_keep
extern uint8_t board_guard[];                  ///< up to board_stack: what a full stack runs into
extern uint8_t board_stack[], board_stack_end[];

/** [bytes] that line_board.c requested from board_keep. */
extern size_t bare_kept;

#endif

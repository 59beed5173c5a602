/* SPDX-License-Identifier: Apache-2.0 */
/* A board with a RISC-V processor of 64 bits without an operating system: QEMU's `virt`. start.S has the start, the
 * vectors, and what an exception leaves; board.c the five functions of targets/bare/port.h, and what is behind them;
 * fault.c the report of an exception. */
#ifndef TARGETS_RISCV64_RISCV64_H
#define TARGETS_RISCV64_RISCV64_H

#define BOARD_PAINT 0x5ac3a53c5ac3a53c /* BARE_PAINT, twice */
#define BOARD_FAULT_STACK 4096         /* [bytes] of the report of a fault */

#ifndef __ASSEMBLER__
#include <stdint.h>

/** Of an exception: x0 to x31. */
extern uint64_t board_registers[32];
extern uint64_t board_fault_stack[BOARD_FAULT_STACK / 8];

/** Where the program was when the watchdog expired; 0: it has not. */
extern uint64_t board_late;

/** Called by start.S: before main; and at an exception, or when the watchdog has expired: it reports so, and resets the
 *  board. */
void board_start(void);
void board_exception(uint64_t cause, uint64_t pc, uint64_t value) __attribute__((noreturn));

/** Reset the board; the memory of board_keep stays as it is. */
void board_reset(void) __attribute__((noreturn));
#endif
#endif

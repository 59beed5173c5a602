/* SPDX-License-Identifier: Apache-2.0 */
/* A board with a Cortex-M7 without an operating system: ARM's MPS2 with its FPGA image AN500, as QEMU's machine
 * mps2-an500 has it. start.c has the vectors and the start, board.c the five functions of targets/bare/port.h, fault.c
 * the report of an exception. The program runs on a stack of its own, all handlers on another one. */
#ifndef TARGETS_CORTEX_M7_CORTEX_M7_H
#define TARGETS_CORTEX_M7_CORTEX_M7_H

#include "targets/bare/memory.h"

#include <stddef.h>
#include <stdint.h>

#ifndef BOARD_PATIENCE_MS
#define BOARD_PATIENCE_MS 10000u /* the watchdog's */
#endif

static inline uint32_t cortex_m7_load(uintptr_t address)
{
    return *(const volatile uint32_t *)address;
}

static inline void cortex_m7_store(uintptr_t address, uint32_t value)
{
    *(volatile uint32_t *)address = value;
}

extern uint8_t cortex_m7_handlers_end[]; ///< of the linker script: the stack of all handlers

/** Start the clock, the UART of the line and the memory protection: start.c calls it. */
void cortex_m7_begin(void);
/** Start anew, as after power-on, but with the memory as it is. */
void board_reset(void) __attribute__((noreturn));

/* Handlers of exceptions, in the table of start.c. */
void cortex_m7_fault(void);
void cortex_m7_beat(void);
void cortex_m7_receive(void);

#endif

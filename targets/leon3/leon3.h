/* SPDX-License-Identifier: Apache-2.0 */
/* A LEON3 board without an operating system: its devices, as plug and play shows them, interrupts, time, contexts.
 * traps.S has the trap table and the start, devices.c plug and play and the console, board.c all else of the board,
 * flight.c its registers and record, runtime.c what the compiler calls, system.c what the C library calls. Sleep, time,
 * watchdog and console are those of targets/bare/bare.h. A program has a function main; no function here uses the
 * heap. */
#ifndef TARGETS_LEON3_LEON3_H
#define TARGETS_LEON3_LEON3_H

#define LEON3_WINDOWS 8        /* of registers; the start refuses another number */
#define LEON3_PAINT 0x5ac3a53c /* of a stack that was never used */
#define LEON3_FAULT_STACK 2048 /* [bytes] of the report of a trap */

#ifndef __ASSEMBLER__
#include "targets/bare/bare.h"
#include "targets/bare/context.h"

/** The addresses of devices; 0: the board has none. */
typedef struct Leon3Devices {
    uint32_t console;          ///< the first APBUART
    uint32_t link;             ///< for records: the SpaceWire link, if it runs, else the last APBUART, or the console
    uint32_t spacewire;        ///< the first GRSPW2
    uint32_t interrupts;       ///< IRQMP
    uint32_t timers;           ///< GPTIMER
    uint32_t timer_line;       ///< its first interrupt
    uint32_t registers;        ///< the register space
    uint32_t registers_line;   ///< the interrupt of a tick; 0: the processor must poll
    uint32_t board_interrupts; ///< interrupts of the boards of the register space, taken so far
} Leon3Devices;

extern Leon3Devices leon3;

/** Find them, enable both UARTs, and start the SpaceWire link. */
void leon3_find_devices(void);

static inline uint32_t leon3_load(uint32_t address)
{
    return *(const volatile uint32_t *)(uintptr_t)address;
}

static inline void leon3_store(uint32_t address, uint32_t value)
{
    *(volatile uint32_t *)(uintptr_t)address = value;
}

/** Runs main: traps.S calls it. */
void leon3_run(void);

/** The words that traps.S stores of an unexpected trap, in this order. */
typedef struct Leon3Fault {
    uint32_t psr, pc, npc, tbr, wim, y, fsr, unused;
    uint32_t g[8], o[8], l[8], i[8];
} Leon3Fault;

/** Prints an unexpected trap on the console, and halts: the watchdog, if it runs, resets the board. */
void leon3_report_fault(const Leon3Fault *fault);

/** The program has ended: stop the watchdog and halt. */
void leon3_stop(int status) __attribute__((noreturn));
/** Halt the processor: it traps while traps are disabled. Emulators see the end of a program, and its status. */
void leon3_halt(int status) __attribute__((noreturn));
/** Reset the board by its watchdog; without one, as leon3_stop(1). */
void leon3_reset(void) __attribute__((noreturn));

/** Called at an interrupt of this level, 1 to 15, with higher levels enabled; enables the level. */
void leon3_on_interrupt(uint32_t level, void (*handler)(void));
/** Called by traps.S. */
void leon3_interrupt(uint32_t level);

/** Send bytes through an APBUART, or as a packet through the SpaceWire link. */
void leon3_send(uint32_t device, const void *bytes, size_t n);
/** The console is silent while this is not 0: if it shares its UART with a record. */
extern int leon3_console_off;

/** [bytes] Of the stack: used so far, and its size. Of the program: what a ROM would hold (code, constants and initial
 *  data), its data, and all RAM that it used so far, its code included, without the heap. */
uint32_t leon3_stack_used(void);
uint32_t leon3_stack_size(void);
uint32_t leon3_program_size(void);
uint32_t leon3_data_size(void);
uint32_t leon3_ram_used(void);
#endif
#endif

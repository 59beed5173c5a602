/* SPDX-License-Identifier: Apache-2.0 */
/* The report of an exception that ends the program of a board, in the form that fledge.targets.faults reads:
 *
 *     fault: WHAT at 0xPC, called from 0xCALLER
 *     r0 0 r1 20000138 ... */
#ifndef TARGETS_BARE_FAULT_H
#define TARGETS_BARE_FAULT_H

#include <stddef.h>
#include <stdint.h>

typedef struct BareFault {
    const char *problem;        ///< "division by zero"
    uintptr_t pc;               ///< of the instruction
    uintptr_t caller;           ///< where its function returns to; 0: not known
    const char *const *names;   ///< of the registers
    const uintptr_t *registers; ///< their values
    size_t n;
} BareFault;

/** Report it by bare_shout, in one text of at most BARE_FAULT_TEXT bytes; registers that do not fit are left out. */
void bare_fault(const BareFault *fault);
enum { BARE_FAULT_TEXT = 512 };

/** Text that goes outside at once, whatever else is being sent: a board without a line has one of its own. It uses
 *  nothing that the program may have spoiled but the line's session. */
void bare_shout(const char *text, size_t n);

#endif

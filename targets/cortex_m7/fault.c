/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/bare/fault.h"
#include "targets/cortex_m7/cortex_m7.h"

#define FAULTS 0xE000ED28u /* what they were */
#define FAULT_ADDRESS 0xE000ED34u
#define MPU_CONTROL 0xE000ED94u
#define EXCEPTION 0x1FFu /* of xPSR */

enum { NMI = 2 };

void cortex_m7_report(const uint32_t *stack, const uint32_t *others);

/* All exceptions but those of start.c's table with a handler of their own: what the processor has stored on the stack
 * that was in use (EXC_RETURN in lr has its number), and r4 to r11, go to C. */
__attribute__((naked)) void cortex_m7_fault(void)
{
    __asm__ volatile("tst lr, #4\n\t"
                     "ite eq\n\t"
                     "mrseq r0, msp\n\t"
                     "mrsne r0, psp\n\t"
                     "push {r4-r11}\n\t"
                     "mov r1, sp\n\t"
                     "bl cortex_m7_report");
}

static const char *problem_of(uint32_t exception, uint32_t faults)
{
    static const struct {
        uint32_t bit;
        const char *problem;
    } known[] = {{4, "stack overflow"},
                 {0, "jump to what is no code"},
                 {1, "access to protected memory"},
                 {8, "jump to where no memory is"},
                 {9, "access to where no memory is"},
                 {10, "write to where no memory is"},
                 {12, "stack outside of the memory"},
                 {16, "unknown instruction"},
                 {17, "jump to an even address"},
                 {18, "wrong return from an exception"},
                 {19, "floating point without its unit"},
                 {24, "access to an address that is not aligned"},
                 {25, "division by zero"}};
    if (exception == NMI) {
        return "watchdog: the program was not idle for 10 s,";
    }
    for (size_t i = 0u; i < sizeof known / sizeof known[0]; i++) {
        if ((faults >> known[i].bit & 1u) != 0u) {
            return known[i].problem;
        }
    }
    return "exception without a handler";
}

/* Whether a function may return there: a call stands before it, BL or BLX. */
static int is_return(uint32_t at)
{
    const uintptr_t code = (uintptr_t)board_code;
    if ((at & 1u) == 0u || at < code + 6u || at >= (uintptr_t)board_code_end) {
        return 0;
    }
    const volatile uint16_t *const next = (const volatile uint16_t *)(uintptr_t)(at - 1u);
    return (next[-1] & 0xFF87u) == 0x4780u || ((next[-2] & 0xF800u) == 0xF000u && (next[-1] & 0xD000u) == 0xD000u);
}

/* Where a function returns to, by the lowest word of the stack from `p` on that can be a return address. */
static uint32_t return_above(uintptr_t p)
{
    for (p = p < (uintptr_t)board_stack ? (uintptr_t)board_stack : p; p < (uintptr_t)board_stack_end; p += 4u) {
        const uint32_t word = cortex_m7_load(p);
        if (is_return(word)) {
            return word & ~1u;
        }
    }
    return 0u;
}

void cortex_m7_report(const uint32_t *stack, const uint32_t *others)
{
    static const char *const names[] = {"number", "cfsr", "address", "psr", "sp", "lr", "r0", "r1",  "r2", "r3",
                                        "r12",    "r4",   "r5",      "r6",  "r7", "r8", "r9", "r10", "r11"};
    uintptr_t registers[sizeof names / sizeof names[0]] = {0};
    const uint32_t faults = cortex_m7_load(FAULTS), overflow = faults & 1u << 4;
    uint32_t number;
    cortex_m7_store(MPU_CONTROL, 0u); /* the stack may be damaged */
    __asm__ volatile("mrs %0, ipsr" : "=r"(number));
    number &= EXCEPTION;
    registers[0] = number;
    registers[1] = faults;
    registers[2] = cortex_m7_load(FAULT_ADDRESS);
    registers[4] = (uintptr_t)stack;
    for (int i = 0; i < 8; i++) {
        registers[11 + i] = others[i];
    }
    BareFault fault = {problem_of(number, faults), 0u, 0u, names, registers, sizeof names / sizeof names[0]};
    if (overflow == 0u && (faults & 1u << 12) == 0u) { /* r0 to r3, r12, lr, pc, psr were stored */
        for (int i = 0; i < 5; i++) {
            registers[6 + i] = stack[i];
        }
        registers[3] = stack[7];
        registers[5] = stack[5];
        fault.pc = stack[6];
        fault.caller = stack[5] & ~(uintptr_t)1;
    } else { /* nothing was: where it was called from is still on the stack */
        fault.pc = return_above((uintptr_t)stack);
    }
    bare_fault(&fault);
    board_reset();
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cortex_m7/cortex_m7.h"

#ifndef CORTEX_M7_LINE
#define CORTEX_M7_LINE 0 /* the number of the interrupt by which bytes of the line come */
#endif

enum { EXCEPTIONS = 16 };

#define COPROCESSORS 0xE000ED88u
#define FPU (0xFu << 20) /* for all */
#define RESET_CONTROL 0xE000ED0Cu
#define RESET_REQUEST 0x05FA0004u

int main(void);
void _exit(int status) __attribute__((noreturn));
void cortex_m7_start(void) __attribute__((noreturn));

/* The stack of handlers, and all exceptions; no other interrupt is enabled than the last one. */
typedef union Vector {
    const void *stack;
    void (*handler)(void);
} Vector;

extern const Vector cortex_m7_vectors[EXCEPTIONS + CORTEX_M7_LINE + 1];

#pragma GCC diagnostic ignored "-Wpedantic" /* ranges */
__attribute__((section(".vectors"), used)) const Vector cortex_m7_vectors[EXCEPTIONS + CORTEX_M7_LINE + 1] = {
    [0] = {.stack = cortex_m7_handlers_end},
    [1] = {.handler = cortex_m7_start},
    [2 ... EXCEPTIONS - 2] = {.handler = cortex_m7_fault},
    [EXCEPTIONS - 1] = {.handler = cortex_m7_beat},
    [EXCEPTIONS + CORTEX_M7_LINE] = {.handler = cortex_m7_receive}};

static __attribute__((noreturn, used)) void run(void)
{
    extern void _set_tls(void *tls);
    _set_tls(board_data); /* what the C library has one of for each thread */
    cortex_m7_begin();
    _exit(main());
}

static uint32_t *words(uint8_t *symbol)
{
    return (uint32_t *)(void *)symbol;
}

void cortex_m7_start(void)
{
    cortex_m7_store(COPROCESSORS, cortex_m7_load(COPROCESSORS) | FPU);
    __asm__ volatile("dsb\n\tisb" ::: "memory");
    const uint32_t *from = words(board_data_load);
    for (uint32_t *to = words(board_data); to < words(board_data_end); to++) {
        *to = *from++;
    }
    for (uint32_t *to = words(board_data_end); to < words(board_bss_end); to++) {
        *to = 0u;
    }
    for (uint32_t *to = words(board_stack); to < words(board_stack_end); to++) {
        *to = BARE_PAINT;
    }
    __asm__ volatile("msr psp, %0\n\t"
                     "mrs r0, control\n\t"
                     "orr r0, #2\n\t" /* the program's stack */
                     "msr control, r0\n\t"
                     "isb\n\t"
                     "b %1"
                     :
                     : "r"(board_stack_end), "i"(run)
                     : "r0", "memory");
    __builtin_unreachable();
}

/* Of the C library, too: a board waits for the next run. */
__attribute__((weak)) void _exit(int status)
{
    (void)status;
    board_reset();
}

void board_reset(void)
{
    __asm__ volatile("dsb" ::: "memory");
    cortex_m7_store(RESET_CONTROL, RESET_REQUEST);
    for (;;) {
    }
}

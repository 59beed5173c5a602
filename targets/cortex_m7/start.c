/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cortex_m7/cortex_m7.h"

enum { EXCEPTIONS = 16, INTERRUPTS = 32 };

#define COPROCESSORS 0xE000ED88u
#define FPU (0xFu << 20) /* for all */
#define RESET_CONTROL 0xE000ED0Cu
#define RESET_REQUEST 0x05FA0004u

int main(void);
void cortex_m7_start(void) __attribute__((noreturn));

/* The stack of handlers, and all exceptions: of those that nothing enables, cortex_m7_fault tells the number. */
typedef union Vector {
    const void *stack;
    void (*handler)(void);
} Vector;

#define FAULT                                                                                                          \
    {                                                                                                                  \
        .handler = cortex_m7_fault                                                                                     \
    }
#define FAULTS_4 FAULT, FAULT, FAULT, FAULT

extern const Vector cortex_m7_vectors[EXCEPTIONS + INTERRUPTS];
__attribute__((section(".vectors"), used))
const Vector cortex_m7_vectors[EXCEPTIONS + INTERRUPTS] = {{.stack = cortex_m7_handlers_end},
                                                           {.handler = cortex_m7_start},
                                                           FAULT,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           {.handler = cortex_m7_beat},
                                                           {.handler = cortex_m7_receive}, /* of the first UART */
                                                           FAULT,
                                                           FAULT,
                                                           FAULT,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           FAULTS_4,
                                                           FAULTS_4};

static __attribute__((noreturn, used)) void run(void)
{
    cortex_m7_begin();
    (void)main();
    cortex_m7_reset(); /* for the next run */
}

void cortex_m7_start(void)
{
    cortex_m7_store(COPROCESSORS, cortex_m7_load(COPROCESSORS) | FPU);
    __asm__ volatile("dsb\n\tisb" ::: "memory");
    const uint32_t *from = cortex_m7_data_load;
    for (uint32_t *to = cortex_m7_data; to < cortex_m7_data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = cortex_m7_data_end; to < cortex_m7_bss_end; to++) {
        *to = 0u;
    }
    for (uint32_t *to = cortex_m7_stack; to < cortex_m7_stack_end; to++) {
        *to = CORTEX_M7_PAINT;
    }
    __asm__ volatile("msr psp, %0\n\t"
                     "mrs r0, control\n\t"
                     "orr r0, #2\n\t" /* the program's stack */
                     "msr control, r0\n\t"
                     "isb\n\t"
                     "b %1"
                     :
                     : "r"(cortex_m7_stack_end), "i"(run)
                     : "r0", "memory");
    __builtin_unreachable();
}

void cortex_m7_reset(void)
{
    __asm__ volatile("dsb" ::: "memory");
    cortex_m7_store(RESET_CONTROL, RESET_REQUEST);
    for (;;) {
    }
}

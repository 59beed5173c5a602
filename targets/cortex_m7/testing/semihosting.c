/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: the end of a program ends its emulator, too, with its status. */
#include <stdint.h>
void _exit(int status) __attribute__((noreturn));

void _exit(int status)
{
    static uint32_t reason[2] = {0x20026u}; /* the application ends */
    reason[1] = (uint32_t)status;
    register uint32_t r0 __asm__("r0") = 0x20u;
    register uint32_t *r1 __asm__("r1") = reason;
    for (;;) {
        __asm__ volatile("bkpt 0xab" : : "r"(r0), "r"(r1) : "memory");
    }
}

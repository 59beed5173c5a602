/* SPDX-License-Identifier: Apache-2.0 */
/* Fill a buffer: with BESIDE_CODE it lies on the page of the code that fills it, else elsewhere. */
#include "bench/guest/guest.h"

enum { N = 256 };

#ifdef BESIDE_CODE
extern uint32_t buffer[N];
__asm__(".section .text.fill, \"ax\"\n\t.align 4096\n\t.global buffer\nbuffer:\n\t.skip 4 * 256\n\t.previous");
#else
static uint32_t buffer[N];
#endif

__attribute__((noinline, section(".text.fill"))) static uint32_t fill(uint32_t *to, uint32_t seed)
{
    for (int i = 0; i < N; i++) {
        seed = seed * 69069u + 1u;
        to[i] = seed;
    }
    return seed;
}

uint32_t work(void)
{
    uint32_t sum = 1;
    for (long n = 0; n < 10000L * ROUNDS; n++) {
        sum = fill(buffer, sum) ^ buffer[n % N];
    }
    return sum;
}

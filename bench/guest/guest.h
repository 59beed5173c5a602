/* SPDX-License-Identifier: Apache-2.0 */
/* A program of the bench: it works for a while and puts a checksum out, which every emulator must agree on. */
#ifndef BENCH_GUEST_H
#define BENCH_GUEST_H

#include <stdint.h>

/** How often to repeat the work; the build may give another number. */
#ifndef ROUNDS
#define ROUNDS 1
#endif

/** The work; the result is a checksum. */
uint32_t work(void);

/** Mix the bits of a number into a checksum. */
static inline uint32_t mix(uint32_t sum, double x)
{
    union {
        double x;
        uint32_t w[2];
    } u = {x};
    sum = (sum ^ u.w[0]) * 16777619u;
    return (sum ^ u.w[1]) * 16777619u;
}

#endif

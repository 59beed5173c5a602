/* SPDX-License-Identifier: Apache-2.0 */
/* A program for the bench of emulators: it works for a while and prints a checksum, on which all must agree. */
#ifndef BENCH_GUEST_H
#define BENCH_GUEST_H

#include <stdint.h>

/** How often the work is repeated: the bench gives the number. */
#ifndef ROUNDS
#define ROUNDS 1
#endif

/** The work; returns the checksum. */
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

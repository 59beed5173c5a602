/* SPDX-License-Identifier: Apache-2.0 */
/* The numbers of a struct without padding, as runs of equal width, to reverse the bytes of each. */
#ifndef FLIGHT_EXEC_ORDER_H
#define FLIGHT_EXEC_ORDER_H

#include <stdint.h>

/** `n` numbers of `width` bytes in a row. */
typedef struct ExecRun {
    uint32_t width; ///< [bytes] 1, 2, 4 or 8
    uint32_t n;
} ExecRun;

/** Whether this machine stores the lowest byte of a number first. */
static inline int exec_little_endian(void)
{
    const uint16_t probe = 1u;
    return *(const uint8_t *)&probe;
}

/** The width of the number that begins at the byte `at` of a struct; 0: none begins there. */
static inline uint32_t exec_number_at(const ExecRun *runs, uint32_t n_runs, uint32_t at)
{
    for (uint32_t i = 0u; i < n_runs; i++) {
        const uint32_t size = runs[i].width * runs[i].n;
        if (at < size) {
            return at % runs[i].width == 0u ? runs[i].width : 0u;
        }
        at -= size;
    }
    return 0u;
}

/** Reverse the bytes of the numbers of a part of a struct, in place: `bytes` is from the byte `from` to the byte `to`,
 *  at both of which a number begins or the struct ends. A second call restores them. */
static inline void exec_reverse(const ExecRun *runs, uint32_t n_runs, uint8_t *bytes, uint32_t from, uint32_t to)
{
    /*@ loop unroll 16; */
    for (uint32_t at = 0u; n_runs > 0u && at < to; runs++, n_runs--) {
        const uint32_t width = runs->width, end = at + width * runs->n;
        uint32_t p = from > at ? from : at;
        /*@ loop unroll 256; */
        for (; p < end && p < to; p += width) {
            /*@ loop unroll 4; */
            for (uint32_t low = p - from, high = low + width - 1u; low < high; low++, high--) {
                const uint8_t byte = bytes[low];
                bytes[low] = bytes[high];
                bytes[high] = byte;
            }
        }
        at = end;
    }
}

/** The same between the order of this machine and big-endian, in either direction. */
static inline void exec_big_endian(const ExecRun *runs, uint32_t n_runs, uint8_t *bytes, uint32_t from, uint32_t to)
{
    /* undecided: a machine has one order */
    if (exec_little_endian()) {
        exec_reverse(runs, n_runs, bytes, from, to);
    }
}

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Sort and check sums of integers. */
#include "bench/guest/guest.h"

enum { N = 4096 };

static uint32_t numbers[N], table[256];

static void sort(uint32_t *a, int n)
{
    for (int gap = n / 2; gap > 0; gap /= 2) {
        for (int i = gap; i < n; i++) {
            const uint32_t x = a[i];
            int j = i;
            for (; j >= gap && a[j - gap] > x; j -= gap) {
                a[j] = a[j - gap];
            }
            a[j] = x;
        }
    }
}

static uint32_t crc32(uint32_t crc, const uint8_t *bytes, int n)
{
    crc = ~crc;
    for (int i = 0; i < n; i++) {
        crc = table[(crc ^ bytes[i]) & 255] ^ (crc >> 8);
    }
    return ~crc;
}

uint32_t work(void)
{
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t c = i;
        for (int k = 0; k < 8; k++) {
            c = (c & 1) != 0 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
        }
        table[i] = c;
    }
    uint32_t crc = 0, seed = 1;
    for (long n = 0; n < 10L * ROUNDS; n++) {
        for (int i = 0; i < N; i++) {
            seed = seed * 1664525u + 1013904223u;
            numbers[i] = seed;
        }
        sort(numbers, N);
        crc = crc32(crc, (const uint8_t *)numbers, (int)sizeof numbers);
    }
    return crc;
}

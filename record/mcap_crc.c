/* SPDX-License-Identifier: Apache-2.0 */
#include "record/mcap_crc.h"

/* In the reflected representation the highest bit is x^0, and a shift to the right multiplies
 * by x. POLYNOMIAL is x^32 mod P. */
#define POLYNOMIAL 0xEDB88320u
#define X_TO_0 0x80000000u
#define X_TO_8 0x00800000u

/* From this length on three lanes take less time than one, including the time to join them. */
#define LANES_FROM ((size_t)16384)

static uint32_t times_x(uint32_t a)
{
    return (a >> 1) ^ ((a & 1u) != 0u ? POLYNOMIAL : 0u);
}

void mcap_crc_init(McapCrc *c)
{
    for (uint32_t b = 0; b < MCAP_CRC_ENTRIES; b++) {
        uint32_t r = b;
        for (int bit = MCAP_CRC_TABLES > 0 ? 8 : 4; bit > 0; bit--) {
            r = times_x(r);
        }
        c->table[0][b] = r;
    }
    for (int k = 1; k < MCAP_CRC_TABLES; k++) {
        for (uint32_t b = 0; b < 256u; b++) {
            uint32_t r = c->table[k - 1][b];
            c->table[k][b] = (r >> 8) ^ c->table[0][r & 0xFFu];
        }
    }
}

/* a b mod P */
static uint32_t multiply(uint32_t a, uint32_t b)
{
    uint32_t product = 0;
    for (uint32_t bit = X_TO_0; bit != 0u; bit >>= 1) {
        product ^= (a & bit) != 0u ? b : 0u;
        b = times_x(b);
    }
    return product;
}

/* x^(8 n) mod P, by which n zero bytes multiply a remainder */
static uint32_t shift_by(uint64_t n)
{
    uint32_t result = X_TO_0;
    for (uint32_t power = X_TO_8; n != 0u; n >>= 1) {
        if ((n & 1u) != 0u) {
            result = multiply(result, power);
        }
        power = multiply(power, power);
    }
    return result;
}

uint32_t mcap_crc_join(uint32_t crc_a, uint32_t crc_b, uint64_t length_b)
{
    return multiply(shift_by(length_b), crc_a) ^ crc_b;
}

#if MCAP_CRC_TABLES == 8
static uint32_t word(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint32_t step8(const McapCrc *c, uint32_t r, const uint8_t *p)
{
    uint32_t a = r ^ word(p);
    uint32_t b = word(p + 4);
    return c->table[7][a & 0xFFu] ^ c->table[6][(a >> 8) & 0xFFu] ^ c->table[5][(a >> 16) & 0xFFu] ^
           c->table[4][a >> 24] ^ c->table[3][b & 0xFFu] ^ c->table[2][(b >> 8) & 0xFFu] ^
           c->table[1][(b >> 16) & 0xFFu] ^ c->table[0][b >> 24];
}
#endif

uint32_t mcap_crc_update(const McapCrc *c, uint32_t crc, const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
#if MCAP_CRC_TABLES == 8
    if (n >= LANES_FROM) {
        /* Each step depends on the one before; three independent lanes use the processor better. */
        size_t lane = n / 24u * 8u;
        uint32_t r0 = ~crc;
        uint32_t r1 = ~0u;
        uint32_t r2 = ~0u;
        for (size_t i = 0; i < lane; i += 8) {
            r0 = step8(c, r0, p + i);
            r1 = step8(c, r1, p + lane + i);
            r2 = step8(c, r2, p + 2u * lane + i);
        }
        uint32_t shift = shift_by(lane);
        crc = multiply(shift, multiply(shift, ~r0) ^ ~r1) ^ ~r2;
        p += 3u * lane;
        n -= 3u * lane;
    }
#endif
    uint32_t r = ~crc;
#if MCAP_CRC_TABLES == 8
    for (; n >= 8u; n -= 8u) {
        r = step8(c, r, p);
        p += 8;
    }
#endif
#if MCAP_CRC_TABLES == 1
    for (; n >= 4u; n -= 4u) { /* a compiler that optimises for size counts after each byte */
        r = (r >> 8) ^ c->table[0][(r ^ p[0]) & 0xFFu];
        r = (r >> 8) ^ c->table[0][(r ^ p[1]) & 0xFFu];
        r = (r >> 8) ^ c->table[0][(r ^ p[2]) & 0xFFu];
        r = (r >> 8) ^ c->table[0][(r ^ p[3]) & 0xFFu];
        p += 4;
    }
#endif
    for (; n > 0u; n--) {
#if MCAP_CRC_TABLES > 0
        r = (r >> 8) ^ c->table[0][(r ^ *p) & 0xFFu];
#else
        r ^= *p;
        r = (r >> 4) ^ c->table[0][r & 0xFu];
        r = (r >> 4) ^ c->table[0][r & 0xFu];
#endif
        p++;
    }
    return ~r;
}

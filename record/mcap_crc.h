/* SPDX-License-Identifier: Apache-2.0 */
/** CRC-32 as MCAP, zlib and Ethernet have it: polynomial 0x04C11DB7, reflected, inverted at both
 *  ends. A buffer is hashed eight bytes a step (slicing-by-8), a long one in three lanes at once.
 *
 *  The tables live in the caller's memory, so that there is no static data and no generated text.
 *  Source: ISO 3309; slicing by Kounavis and Berry, IEEE Trans. Computers 57 (2008) 1550. */
#ifndef RECORD_MCAP_CRC_H
#define RECORD_MCAP_CRC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** 8 tables take 8 KiB and hash 8 bytes a step. Where memory is short: 1 takes 1 KiB and hashes a byte a step,
 *  0 takes 64 bytes and hashes half a byte a step. */
#ifndef MCAP_CRC_TABLES
#define MCAP_CRC_TABLES 8
#endif
#define MCAP_CRC_ENTRIES (MCAP_CRC_TABLES > 0 ? 256 : 16)

typedef struct McapCrc {
    /** table[k][b]: the remainder of byte b, or of half a byte, followed by k zero bytes. */
    uint32_t table[MCAP_CRC_TABLES > 0 ? MCAP_CRC_TABLES : 1][MCAP_CRC_ENTRIES];
} McapCrc;

void mcap_crc_init(McapCrc *c);

/** The CRC of (what `crc` covers, then these n bytes). The CRC of nothing is 0. */
uint32_t mcap_crc_update(const McapCrc *c, uint32_t crc, const void *bytes, size_t n);

/** The CRC of A followed by B from crc(A), crc(B) and the length of B [bytes]: no byte is read. */
uint32_t mcap_crc_join(uint32_t crc_a, uint32_t crc_b, uint64_t length_b);

#ifdef __cplusplus
}
#endif
#endif

/* SPDX-License-Identifier: Apache-2.0 */
/** CRC-32 as in MCAP, zlib and Ethernet: polynomial 0x04C11DB7, reflected, inverted at both ends. The code hashes eight
 *  bytes per step (slicing-by-8), and long buffers in three lanes at once.
 *
 *  The tables live in the caller's memory, so there are no static data and no generated code.
 *  Source: ISO 3309; slicing by Kounavis and Berry, IEEE Trans. Computers 57 (2008) 1550. */
#ifndef RECORD_MCAP_CRC_H
#define RECORD_MCAP_CRC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** 8 tables take 8 KiB and hash 8 bytes a step. For small memory: 1 takes 1 KiB and hashes a byte a step,
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

/** Continue a CRC with n more bytes. The CRC of no bytes is 0. */
uint32_t mcap_crc_update(const McapCrc *c, uint32_t crc, const void *bytes, size_t n);

/** The CRC of A followed by B from crc(A), crc(B) and the length of B [bytes], without reading a byte. */
uint32_t mcap_crc_join(uint32_t crc_a, uint32_t crc_b, uint64_t length_b);

#ifdef __cplusplus
}
#endif
#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Big-endian numbers in bytes, and why bytes are refused. */
#ifndef CCSDS_BYTES_H
#define CCSDS_BYTES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Why a packet, a frame or a codeblock is refused. Operators read these numbers: append, do not renumber. */
typedef enum CcsdsFault {
    CCSDS_OK = 0,
    CCSDS_SHORT = 1,        ///< fewer bytes than its header
    CCSDS_LENGTH = 2,       ///< not the length that its header or its channel says
    CCSDS_VERSION = 3,      ///< another version of the protocol
    CCSDS_SPACECRAFT = 4,   ///< for another spacecraft
    CCSDS_CHANNEL = 5,      ///< of a virtual channel, or a MAP, that is not there
    CCSDS_CRC = 6,          ///< its check of bytes does not hold
    CCSDS_TYPE = 7,         ///< a combination of flags, or a control command, that does not exist
    CCSDS_GAP = 8,          ///< what came before it is missing
    CCSDS_ROOM = 9,         ///< larger than the memory for it
    CCSDS_STRAY = 10,       ///< the rest of something whose beginning did not come
    CCSDS_ASSOCIATION = 11, ///< of a security association that is not there, or not in operation
    CCSDS_TAG = 12,         ///< its message authentication code does not hold
    CCSDS_REPLAY = 13,      ///< it was accepted before, or is too old to tell
    CCSDS_FAULTS
} CcsdsFault;

static inline uint16_t ccsds_get16(const uint8_t *p)
{
    return (uint16_t)((uint32_t)p[0] << 8 | p[1]);
}

static inline uint32_t ccsds_get24(const uint8_t *p)
{
    return (uint32_t)p[0] << 16 | (uint32_t)p[1] << 8 | p[2];
}

static inline uint32_t ccsds_get32(const uint8_t *p)
{
    return (uint32_t)ccsds_get16(p) << 16 | ccsds_get16(p + 2);
}

static inline uint64_t ccsds_get64(const uint8_t *p)
{
    return (uint64_t)ccsds_get32(p) << 32 | ccsds_get32(p + 4);
}

static inline void ccsds_put16(uint8_t *p, uint32_t value)
{
    p[0] = (uint8_t)(value >> 8);
    p[1] = (uint8_t)value;
}

static inline void ccsds_put32(uint8_t *p, uint32_t value)
{
    ccsds_put16(p, value >> 16);
    ccsds_put16(p + 2, value);
}

static inline void ccsds_put64(uint8_t *p, uint64_t value)
{
    ccsds_put32(p, (uint32_t)(value >> 32));
    ccsds_put32(p + 4, (uint32_t)value);
}

/** The check below of n more bytes behind those with the check `crc`. */
static inline uint16_t ccsds_crc16_more(uint32_t crc, const uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t x = (crc >> 8 ^ bytes[i]) & 0xFFu; /* a byte at once: what the eight shifts add up to */
        x ^= x >> 4;
        crc = (crc << 8 ^ x << 12 ^ x << 5 ^ x) & 0xFFFFu;
    }
    return (uint16_t)crc;
}

/** The cyclic redundancy check of frames (132.0-B-3, 4.1.6; 232.0-B-4, 4.1.4): x^16 + x^12 + x^5 + 1, begun with
 * 0xFFFF. A frame with its check behind it has the check 0. */
static inline uint16_t ccsds_crc16(const uint8_t *bytes, size_t n)
{
    return ccsds_crc16_more(0xFFFFu, bytes, n);
}

#ifdef __cplusplus
}
#endif

#endif

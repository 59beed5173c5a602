/* SPDX-License-Identifier: Apache-2.0 */
/* Time codes (CCSDS 301.0-B-4), of the secondary headers of packets. Both ends know the form of the code, so it has no
 * preamble. Times are in ns since the epoch of the code: 1958-01-01 TAI for CUC and 1958-01-01 UTC for CDS, unless the
 * mission has its own. */
#ifndef CCSDS_TIME_CODE_H
#define CCSDS_TIME_CODE_H

#include "ccsds/bytes.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    TIME_CDS = 8 ///< [bytes] of CDS with 2 bytes of days and 2 of microseconds
};

/** Unsegmented: `coarse` bytes (1 to 4) of seconds and `fine` bytes (0 to 3) of their binary fraction. The time is the
 * first of those whose code it is. */
static inline int64_t time_cuc_read(const uint8_t *bytes, uint32_t coarse, uint32_t fine)
{
    uint64_t ticks = 0u;
    for (uint32_t i = 0u; i < coarse + fine; i++) {
        ticks = ticks << 8 | bytes[i];
    }
    const uint64_t seconds = ticks >> 8u * fine, rest = ticks & ((1ull << 8u * fine) - 1u);
    return (int64_t)(seconds * 1000000000u + ((rest * 1000000000u + (1ull << 8u * fine) - 1u) >> 8u * fine));
}

/** t: 0 or more; what is beyond the seconds' bytes is cut off. */
static inline void time_cuc_write(int64_t t, uint8_t *bytes, uint32_t coarse, uint32_t fine)
{
    const uint64_t seconds = (uint64_t)t / 1000000000u, rest = (uint64_t)t % 1000000000u;
    uint64_t ticks = seconds << 8u * fine | (rest << 8u * fine) / 1000000000u;
    for (uint32_t i = coarse + fine; i-- > 0u; ticks >>= 8) {
        bytes[i] = (uint8_t)ticks;
    }
}

/** Segmented: 2 bytes of days, 4 of milliseconds of the day, 2 of microseconds. A second that leaps in is that of the
 * next day. */
static inline int64_t time_cds_read(const uint8_t *bytes)
{
    return ((ccsds_get16(bytes) * 86400000ll + ccsds_get32(bytes + 2)) * 1000 + ccsds_get16(bytes + 6)) * 1000;
}

/** t: 0 or more, before day 65536. */
static inline void time_cds_write(int64_t t, uint8_t *bytes)
{
    const int64_t ms = t / 1000000;
    ccsds_put16(bytes, (uint32_t)(ms / 86400000));
    ccsds_put32(bytes + 2, (uint32_t)(ms % 86400000));
    ccsds_put16(bytes + 6, (uint32_t)(t / 1000 % 1000));
}

#ifdef __cplusplus
}
#endif

#endif

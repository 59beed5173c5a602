/* SPDX-License-Identifier: Apache-2.0 */
/* Frames in a stream of bytes: synchronisation markers and randomisers (CCSDS 131.0-B, 231.0-B), and the command link
 * transmission units (CLTU) of telecommands with their BCH code (231.0-B). Readers take whole bytes: they do not look
 * for a frame that begins inside a byte. */
#ifndef CCSDS_SYNC_H
#define CCSDS_SYNC_H

#include "ccsds/bytes.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SYNC_MARKER 0x1ACFFC1Du ///< in front of a telemetry frame

enum {
    SYNC_MARKER_BYTES = 4,
    CLTU_BLOCK = 8, ///< [bytes] of a codeblock: 7 of data, 1 of parity
    CLTU_DATA = 7,
    CLTU_START = 2, ///< [bytes]
    CLTU_TAIL = 8   ///< [bytes]
};

/** [bytes] of the CLTU of n bytes. */
#define CLTU_SIZE(n) (CLTU_START + ((n) + CLTU_DATA - 1) / CLTU_DATA * CLTU_BLOCK + CLTU_TAIL)

/** Randomise telemetry in place, or undo it: x^8 + x^7 + x^5 + x^3 + 1, begun with ones. The marker is left out. */
void sync_randomise_tm(uint8_t *bytes, size_t n);

/** The same for telecommands: x^8 + x^6 + x^4 + x^3 + x^2 + x + 1. */
void sync_randomise_tc(uint8_t *bytes, size_t n);

typedef void (*SyncSink)(void *user, uint8_t *frame, size_t n);

/** Finds frames of one size behind markers in a stream of bytes. */
typedef struct SyncReader {
    uint8_t *memory; ///< for a frame
    size_t size;     ///< [bytes] of a frame, without the marker
    size_t n;        ///< [bytes] of it that are there
    uint32_t window; ///< the last four bytes, where a marker is looked for
    uint8_t seen;    ///< bytes of the window that are there
    uint8_t locked;  ///< 1: the last marker stood where it should
    uint8_t inside;  ///< 1: in a frame
    uint8_t errors;  ///< wrong bits that a marker may have where one should stand
    SyncSink sink;
    void *user;
    uint32_t frames;
    uint32_t lost;    ///< how often a marker did not stand where it should
    uint32_t skipped; ///< [bytes] between frames
} SyncReader;

void sync_begin(SyncReader *reader, uint8_t *memory, size_t size, uint8_t errors, SyncSink sink, void *user);
void sync_take(SyncReader *reader, const uint8_t *bytes, size_t n);

/** Write the CLTU of n bytes (one or more frames, randomised or not) into CLTU_SIZE(n) bytes. Returns that size. */
size_t cltu_write(const uint8_t *bytes, size_t n, uint8_t *cltu);

/** Finds CLTUs in a stream of bytes, and corrects one wrong bit in each codeblock. */
typedef struct CltuReader {
    uint8_t *memory; ///< for the data of a CLTU
    size_t room;
    size_t n;
    uint32_t window;
    uint8_t block[CLTU_BLOCK];
    uint8_t filled; ///< bytes of the block that are there
    uint8_t inside; ///< 1: after a start sequence
    SyncSink sink;
    void *user;
    uint32_t units;     ///< CLTUs with at least one codeblock
    uint32_t corrected; ///< codeblocks with one wrong bit
    uint32_t faults[CCSDS_FAULTS];
} CltuReader;

void cltu_begin(CltuReader *reader, uint8_t *memory, size_t room, SyncSink sink, void *user);

/** Take bytes. A CLTU ends with the first codeblock that cannot be corrected, as its tail is made to be; its data goes
 * to the sink, with what fills the last block behind it. */
void cltu_take(CltuReader *reader, const uint8_t *bytes, size_t n);

#ifdef __cplusplus
}
#endif

#endif

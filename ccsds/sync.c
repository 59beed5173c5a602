/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/sync.h"

#include <string.h>

/* ---- randomisers */

/* taps: bit i is that of the register which is i places before the next bit. */
static void randomise(uint8_t *bytes, size_t n, uint32_t taps)
{
    uint32_t state = 0xFFu; /* its highest bit is the next one out */
    for (size_t i = 0; i < n; i++) {
        uint32_t out = 0u;
        for (int bit = 0; bit < 8; bit++) {
            uint32_t parity = state & taps;
            parity ^= parity >> 4;
            parity ^= parity >> 2;
            parity ^= parity >> 1;
            out = out << 1 | state >> 7;
            state = (state << 1 | (parity & 1u)) & 0xFFu;
        }
        bytes[i] ^= (uint8_t)out;
    }
}

void sync_randomise_tm(uint8_t *bytes, size_t n)
{
    randomise(bytes, n, 0x95u); /* s(n) = s(n - 8) + s(n - 5) + s(n - 3) + s(n - 1) */
}

void sync_randomise_tc(uint8_t *bytes, size_t n)
{
    randomise(bytes, n, 0xFAu); /* s(n) = s(n - 8) + s(n - 7) + s(n - 6) + s(n - 5) + s(n - 4) + s(n - 2) */
}

/* ---- markers */

static uint32_t ones(uint32_t word)
{
    uint32_t n = 0u;
    /* at most 32: each round clears a bit */
    for (; word != 0u; word &= word - 1u) {
        n++;
    }
    return n;
}

void sync_begin(SyncReader *reader, uint8_t *memory, size_t size, uint8_t errors, SyncSink sink, void *user)
{
    memset(reader, 0, sizeof *reader);
    reader->memory = memory;
    reader->size = size;
    reader->errors = errors;
    reader->sink = sink;
    reader->user = user;
}

void sync_take(SyncReader *reader, const uint8_t *bytes, size_t n)
{
    while (n != 0) {
        if (reader->inside != 0u) {
            const size_t left = reader->size - reader->n, part = left < n ? left : n;
            memcpy(reader->memory + reader->n, bytes, part);
            reader->n += part;
            bytes += part;
            n -= part;
            if (reader->n == reader->size) {
                reader->inside = 0u;
                reader->n = 0;
                reader->locked = 1u;
                reader->seen = 0u;
                reader->frames++;
                reader->sink(reader->user, reader->memory, reader->size);
            }
            continue;
        }
        reader->window = reader->window << 8 | *bytes++;
        n--;
        if (reader->seen < (uint8_t)SYNC_MARKER_BYTES) {
            reader->seen++;
        } else {
            reader->skipped++;
        }
        if (reader->seen < (uint8_t)SYNC_MARKER_BYTES) {
            continue;
        }
        if (ones(reader->window ^ SYNC_MARKER) <= (reader->locked != 0u ? reader->errors : 0u)) {
            reader->inside = 1u;
        } else if (reader->locked != 0u) {
            reader->lost++;
        }
        reader->locked = 0u;
    }
}

/* ---- CLTU */

static const uint8_t start[CLTU_START] = {0xEB, 0x90};
static const uint8_t tail[CLTU_TAIL] = {0xC5, 0xC5, 0xC5, 0xC5, 0xC5, 0xC5, 0xC5, 0x79};

/* The 7 bits of parity of 56 bits: the remainder by x^7 + x^6 + x^2 + 1. */
static uint32_t bch(const uint8_t *data)
{
    uint32_t r = 0u;
    for (int i = 0; i < CLTU_DATA; i++) {
        /*@ loop unroll 8; */
        for (uint32_t bit = 0x80u; bit != 0u; bit >>= 1) {
            const uint32_t out = (r >> 6 & 1u) ^ ((data[i] & bit) != 0u ? 1u : 0u);
            r = (r << 1 & 0x7Fu) ^ (out != 0u ? 0x45u : 0u);
        }
    }
    return r;
}

/* The last byte of a codeblock: the complement of the parity, and a bit 0 that fills. */
static uint8_t parity_of(const uint8_t *data)
{
    return (uint8_t)((bch(data) ^ 0x7Fu) << 1);
}

size_t cltu_write(const uint8_t *bytes, size_t n, uint8_t *cltu)
{
    uint8_t *p = cltu;
    memcpy(p, start, sizeof start);
    p += sizeof start;
    for (size_t at = 0; at < n; at += (size_t)CLTU_DATA) {
        const size_t part = n - at < (size_t)CLTU_DATA ? n - at : (size_t)CLTU_DATA;
        memset(p, 0x55, CLTU_DATA);
        memcpy(p, bytes + at, part);
        p[CLTU_DATA] = parity_of(p);
        p += CLTU_BLOCK;
    }
    memcpy(p, tail, sizeof tail);
    return (size_t)(p - cltu) + sizeof tail;
}

/* Correct at most one wrong bit. Returns 0 if more are wrong, else 1, and 2 if one was. */
static int correct(uint8_t *block)
{
    const uint32_t syndrome = ((uint32_t)(block[CLTU_DATA] ^ parity_of(block)) >> 1) & 0x7Fu;
    if (syndrome == 0u) {
        return 1; /* the bit that fills is no part of the code */
    }
    if (ones(syndrome) == 1u) {
        block[CLTU_DATA] ^= (uint8_t)(syndrome << 1);
        return 2;
    }
    for (uint32_t bit = 0u; bit < 56u; bit++) {
        uint8_t error[CLTU_DATA] = {0u};
        error[bit / 8u] = (uint8_t)(0x80u >> bit % 8u);
        if (bch(error) == syndrome) {
            block[bit / 8u] ^= error[bit / 8u];
            return 2;
        }
    }
    return 0;
}

void cltu_begin(CltuReader *reader, uint8_t *memory, size_t room, SyncSink sink, void *user)
{
    memset(reader, 0, sizeof *reader);
    reader->memory = memory;
    reader->room = room;
    reader->sink = sink;
    reader->user = user;
}

static void end_unit(CltuReader *reader)
{
    reader->inside = 0u;
    reader->window = 0u;
    if (reader->n != 0) {
        reader->units++;
        reader->sink(reader->user, reader->memory, reader->n);
    }
}

void cltu_take(CltuReader *reader, const uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (reader->inside == 0u) {
            reader->window = (reader->window << 8 | bytes[i]) & 0xFFFFu;
            if (reader->window == ccsds_get16(start)) {
                reader->inside = 1u;
                reader->filled = 0u;
                reader->n = 0;
            }
            continue;
        }
        reader->block[reader->filled++] = bytes[i];
        if (reader->filled < (uint8_t)CLTU_BLOCK) {
            continue;
        }
        reader->filled = 0u;
        const int good = correct(reader->block);
        if (good == 0) {
            end_unit(reader);
        } else if (reader->room - reader->n < (size_t)CLTU_DATA) {
            reader->faults[CCSDS_ROOM]++;
            reader->n = 0;
            end_unit(reader);
        } else {
            reader->corrected += good == 2;
            memcpy(reader->memory + reader->n, reader->block, CLTU_DATA);
            reader->n += CLTU_DATA;
        }
    }
}

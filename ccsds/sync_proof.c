/* SPDX-License-Identifier: Apache-2.0 */
/* Any bytes, in parts of each length up to PART, behind which there is no memory, in any state of the readers of
 * markers and of CLTUs: what holds between parts is assumed, and asserted again. Then CLTUs of each length are written.
 *
 * options: -eva-precision 0 -eva-slevel 300 -eva-auto-loop-unroll 64 */
#include "ccsds/sync.h"

enum { FRAME = 4, UNIT = 16, PART = 9 };

static uint8_t bytes[PART], frame[FRAME], unit[UNIT], cltu[CLTU_SIZE(UNIT)];
static SyncReader reader;
static CltuReader units;

static void take_frame(void *user, uint8_t *taken, size_t n)
{
    (void)user;
    /*@ assert frame: taken == &frame[0] && n == FRAME; */
    sync_randomise_tm(taken, n);
}

static void take_unit(void *user, uint8_t *taken, size_t n)
{
    (void)user;
    /*@ assert unit: taken == &unit[0] && 0 < n <= UNIT; */
    sync_randomise_tc(taken, n);
}

/* there: [bytes] of a frame. */
static void markers(uint8_t inside, size_t there, size_t n)
{
    any_bits(&reader, sizeof reader);
    any_bits(bytes, sizeof bytes);
    reader.memory = frame;
    reader.size = sizeof frame;
    reader.sink = take_frame;
    reader.inside = inside;
    reader.n = there;
    sync_take(&reader, bytes + PART - n, n);
    /*@ assert between: reader.n < reader.size; */
}

/* there: [bytes] of a codeblock. */
static void codeblocks(uint8_t inside, uint8_t there, size_t n)
{
    any_bits(&units, sizeof units);
    any_bits(bytes, sizeof bytes);
    units.memory = unit;
    units.room = sizeof unit;
    units.sink = take_unit;
    units.inside = inside;
    units.filled = there;
    units.n = (size_t)any_unsigned(0u, sizeof unit);
    cltu_take(&units, bytes + PART - n, n);
    /*@ assert between: units.filled < CLTU_BLOCK && units.n <= units.room; */
}

void main(void)
{
    /*@ loop unroll 10; */
    for (size_t n = 0; n <= (size_t)PART; n++) {
        codeblocks(0u, 0u, n);
        /*@ loop unroll 4; */
        for (size_t there = 0; there < (size_t)FRAME; there++) {
            markers(0u, there, n);
            markers(1u, there, n);
        }
        /*@ loop unroll 8; */
        for (uint8_t there = 0u; there < (uint8_t)CLTU_BLOCK; there++) {
            codeblocks(1u, there, n);
        }
    }
    /*@ loop unroll 16; */
    for (size_t n = 1; n <= (size_t)UNIT; n++) {
        any_bits(unit, sizeof unit);
        const size_t size = cltu_write(unit + UNIT - n, n, cltu);
        /*@ assert whole: size <= sizeof(cltu); */
    }
}

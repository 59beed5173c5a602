/* SPDX-License-Identifier: Apache-2.0 */
/* Any frames of telemetry, TM and AOS, of each length up to MOST, behind which there is no memory.
 *
 * options: -eva-split-return auto */
#include "ccsds/tm_frame.h"

enum { MOST = 24, NONE = 20 };

static uint8_t memory[MOST];

/* The bytes that are read are there. */
static void touch(const TmFrame *frame)
{
    any = frame->zone[0] + frame->zone[frame->n - 1u];
}

/* secondary: the first byte of a secondary header; those that are longer do not fit. */
static void take(size_t n, uint32_t control, uint8_t check, uint8_t secondary)
{
    uint8_t *bytes = memory + MOST - n;
    TmChannel channel;
    TmFrame frame;
    any_bits(memory, sizeof memory);
    bytes[1] = (uint8_t)(any_unsigned(0u, 127u) << 1 | control);
    if (n > 6u) {
        bytes[4] = (uint8_t)any_unsigned(secondary < NONE ? 128u : 0u, secondary < NONE ? 255u : 127u);
        bytes[6] = secondary < NONE ? secondary : bytes[6];
    }
    any_bits(&channel, sizeof channel);
    channel.check = check;
    if (tm_frame_read(&channel, bytes, n, &frame) == CCSDS_OK) {
        touch(&frame);
    }
    /*@ loop unroll 3; */
    for (size_t before = 0; before <= 4u; before += 2u) {
        TmFrame aos;
        if (aos_frame_read(bytes, n, before, (int)control, check, &aos) == CCSDS_OK) {
            touch(&aos);
        }
    }
}

void main(void)
{
    TmFrame frame;
    (void)tm_frame_read(&(TmChannel){.size = 0u}, memory + MOST, 0, &frame);
    /*@ loop unroll 25; */
    for (size_t n = 2; n <= (size_t)MOST; n++) {
        /*@ loop unroll 4; */
        for (uint32_t flags = 0u; flags < 4u; flags++) {
            take(n, flags & 1u, (uint8_t)(flags >> 1), NONE);
        }
    }
    /*@ loop unroll 20; */
    for (uint8_t secondary = 0u; secondary < (uint8_t)NONE; secondary++) {
        take(MOST, 0u, 0u, secondary);
        take(MOST, 1u, 1u, secondary);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Any telecommand frame for any channel, of each length up to MOST, behind which there is no memory; then any up to
 * the largest. FARM-1 takes what is read. And any frame is written.
 *
 * options: -eva-split-return auto -eva-interprocedural-splits -eva-split-limit 1100 */
#include "ccsds/farm.c"

enum { MOST = 16 };

static uint8_t memory[TC_FRAME_MAX], written[TC_FRAME_MAX];
static Farm farm;

static TcChannel any_channel(void)
{
    TcChannel channel;
    any_bits(&channel, sizeof channel);
    channel.segments = (uint8_t)any_unsigned(0u, 1u);
    channel.check = (uint8_t)any_unsigned(0u, 1u);
    return channel;
}

static void take(const uint8_t *bytes, size_t n)
{
    const TcChannel channel = any_channel();
    //@ split channel.segments;
    //@ split channel.check;
    TcFrame frame;
    if (tc_frame_read(&channel, bytes, n, &frame) != CCSDS_OK) {
        return;
    }
    if (bytes != memory && frame.data != NULL && frame.n != 0) { /* all bytes that it names are there */
        any = frame.data[0] + frame.data[frame.n - 1u];
    }
    (void)farm_frame(&farm, &frame, any);
    Clcw clcw = farm_clcw(&farm, channel.virtual_channel);
    (void)clcw_read(clcw_word(&clcw), &clcw);
    if (any) {
        farm_room(&farm);
    }
}

static void write(void)
{
    static uint8_t data[TC_FRAME_MAX];
    const TcChannel channel = any_channel();
    //@ split channel.segments;
    //@ split channel.check;
    TcFrame frame;
    any_bits(&frame, sizeof frame);
    any_bits(data, sizeof data);
    frame.data = data;
    frame.n = (size_t)any_unsigned(0u, sizeof data);
    const size_t n =
        any ? tc_frame_write(&channel, &frame, written)
            : tc_control_write(&channel, any ? TC_SET : TC_UNLOCK, (uint8_t)any_unsigned(0u, 255u), written);
    /*@ assert fits: n <= sizeof(written); */
}

void main(void)
{
    (void)farm_begin(&farm, (uint8_t)any_unsigned(0u, 255u));
    /*@ loop unroll 17; */
    for (size_t n = 0; n <= (size_t)MOST; n++) {
        any_bits(memory, sizeof memory);
        take(memory + TC_FRAME_MAX - n, n);
    }
    while (any) {
        any_bits(memory, sizeof memory);
        take(memory, (size_t)any_unsigned(0u, sizeof memory));
    }
    write();
}

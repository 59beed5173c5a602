/* SPDX-License-Identifier: Apache-2.0 */
/* Any bytes, of each length up to MOST, behind which there is no memory; and parts of any unit.
 *
 * options: -eva-split-return auto -eva-interprocedural-splits -eva-split-limit 1100 */
#include "ccsds/packet_zone.h"
#include "ccsds/space_packet.h"
#include "ccsds/time_code.h"

enum { MOST = 24 };

static uint8_t memory[MOST];

static void read_all(const uint8_t *bytes, size_t n)
{
    SpacePacket packet;
    PusHeader header;
    uint32_t size;
    if (packet_size(bytes, n, &size) == CCSDS_OK) {
        (void)packet_is_idle(bytes);
    }
    (void)space_packet_read(&packet, bytes, n);
    const int command = (int)any_integer(0, 1);
    //@ split command;
    if (pus_read(&header, command, bytes, n) == CCSDS_OK) {
        uint8_t written[PUS_TELEMETRY];
        (void)pus_write(&header, command, written);
    }
}

static void split(void)
{
    static uint8_t data[12], bytes[SPACE_PACKET_HEADER + 4];
    any_bits(data, sizeof data);
    PacketSplitter splitter;
    any_bits(&splitter.head, sizeof splitter.head);
    const size_t n = (size_t)any_unsigned(0u, sizeof data);
    //@ split n;
    splitter.data = data + sizeof data - n;
    splitter.n = n;
    const size_t room = (size_t)any_unsigned(1u, sizeof bytes - SPACE_PACKET_HEADER);
    //@ split room;
    splitter.room = room;
    /*@ loop unroll 14; */
    while (packet_split(&splitter, bytes) != 0) {
    }
}

static void join(void)
{
    static uint8_t unit[16];
    PacketJoiner joiner;
    packet_joiner_begin(&joiner, (uint16_t)any_unsigned(0u, 0xFFFFu), unit, sizeof unit);
    //@ dynamic_split joiner.parts.n;
    while (any) {
        any_bits(memory, sizeof memory);
        const size_t n = (size_t)any_unsigned(0u, sizeof memory);
        //@ split n;
        (void)packet_join(&joiner, memory, n);
    }
}

static void times(void)
{
    any_bits(memory, sizeof memory);
    /*@ loop unroll 4; */
    for (uint32_t coarse = 1u; coarse <= 4u; coarse++) {
        /*@ loop unroll 4; */
        for (uint32_t fine = 0u; fine <= 3u; fine++) {
            (void)time_cuc_read(memory + MOST - coarse - fine, coarse, fine);
            time_cuc_write(any_integer(0, INT64_MAX), memory + MOST - coarse - fine, coarse, fine);
        }
    }
    (void)time_cds_read(memory + MOST - TIME_CDS);
    time_cds_write(any_integer(0, INT64_C(86400000000000) * 65536 - 1), memory + MOST - TIME_CDS);
}

void main(void)
{
    /*@ loop unroll 25; */
    for (size_t n = 1; n <= (size_t)MOST; n++) {
        /*@ loop unroll 9; */
        for (uint32_t version = 0u; version < 8u; version++) {
            any_bits(memory, sizeof memory);
            memory[(size_t)MOST - n] = (uint8_t)any_unsigned(version << 5, (version << 5) + 31u);
            read_all(memory + MOST - n, n);
        }
    }
    read_all(memory + MOST, 0);
    split();
    join();
    times();
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/tc_frame.h"

#include <string.h>

enum { BYPASS = 0x2000, CONTROL = 0x1000, SPARE = 0x0C00 }; /* of the first word */

CcsdsFault tc_frame_read(const TcChannel *channel, const uint8_t *bytes, size_t n, TcFrame *frame)
{
    if (n < (size_t)TC_FRAME_HEADER) {
        return CCSDS_SHORT;
    }
    const uint32_t id = ccsds_get16(bytes), word = ccsds_get16(bytes + 2);
    const size_t size = (word & 0x3FFu) + 1u;
    if (size > n) {
        return CCSDS_LENGTH;
    }
    size_t at = TC_FRAME_HEADER, end = size;
    if (channel->check) {
        if (size < at + 2u || ccsds_crc16(bytes, size) != 0u) {
            return CCSDS_CRC;
        }
        end -= 2u;
    }
    if (id >> 14 != 0u || (id & (uint32_t)SPARE) != 0u) {
        return CCSDS_VERSION;
    }
    if ((id & 0x3FFu) != channel->spacecraft) {
        return CCSDS_SPACECRAFT;
    }
    if (word >> 10 != channel->virtual_channel) {
        return CCSDS_CHANNEL;
    }
    if (end <= at) {
        return CCSDS_LENGTH; /* without data */
    }
    memset(frame, 0, sizeof *frame);
    frame->size = size;
    frame->number = bytes[4];
    frame->part = SPACE_PACKET_WHOLE;
    const int bypass = (id & (uint32_t)BYPASS) != 0u, control = (id & (uint32_t)CONTROL) != 0u;
    if (control) {
        const uint8_t *command = bytes + at;
        frame->type = TC_BC;
        if (!bypass) {
            return CCSDS_TYPE;
        }
        if (end - at == 1u && command[0] == 0u) {
            frame->control = TC_UNLOCK;
        } else if (end - at == 3u && command[0] == 0x82u && command[1] == 0u) {
            frame->control = TC_SET;
            frame->value = command[2];
        } else {
            return CCSDS_TYPE;
        }
        return CCSDS_OK;
    }
    frame->type = (uint8_t)(bypass ? TC_BD : TC_AD);
    if (channel->segments) {
        frame->part = bytes[at] >> 6;
        frame->map = bytes[at] & 0x3Fu;
        at++;
    }
    frame->data = bytes + at;
    frame->n = end - at;
    return frame->n == 0 ? CCSDS_LENGTH : CCSDS_OK;
}

/* The header in front, and the check behind n bytes; returns the size of all. */
static size_t finish(const TcChannel *channel, uint32_t flags, uint8_t number, uint8_t *bytes, size_t n)
{
    const size_t size = n + (channel->check ? 2u : 0u);
    ccsds_put16(bytes, flags | channel->spacecraft);
    ccsds_put16(bytes + 2, (uint32_t)channel->virtual_channel << 10 | (uint32_t)(size - 1u));
    bytes[4] = number;
    if (channel->check) {
        ccsds_put16(bytes + n, ccsds_crc16(bytes, n));
    }
    return size;
}

size_t tc_frame_write(const TcChannel *channel, const TcFrame *frame, uint8_t *bytes)
{
    size_t at = TC_FRAME_HEADER;
    if (frame->n == 0 || frame->n > tc_room(channel)) {
        return 0;
    }
    if (channel->segments) {
        bytes[at++] = (uint8_t)((uint32_t)frame->part << 6 | frame->map);
    }
    memmove(bytes + at, frame->data, frame->n);
    return finish(channel, frame->type == (uint8_t)TC_BD ? BYPASS : 0u, frame->number, bytes, at + frame->n);
}

size_t tc_control_write(const TcChannel *channel, TcControl control, uint8_t value, uint8_t *bytes)
{
    size_t at = TC_FRAME_HEADER;
    if (control == TC_SET) {
        bytes[at++] = 0x82u;
        bytes[at++] = 0u;
        bytes[at++] = value;
    } else {
        bytes[at++] = 0u;
    }
    return finish(channel, (uint32_t)BYPASS | (uint32_t)CONTROL, 0u, bytes, at);
}

uint32_t clcw_word(const Clcw *clcw)
{
    return 1u << 24 | (uint32_t)(clcw->virtual_channel & 0x3Fu) << 18 | (clcw->no_rf & 1u) << 15 |
           (clcw->no_bit_lock & 1u) << 14 | (clcw->lockout & 1u) << 13 | (clcw->wait & 1u) << 12 |
           (clcw->retransmit & 1u) << 11 | (uint32_t)(clcw->bypasses & 3u) << 9 | clcw->next;
}

int clcw_read(uint32_t word, Clcw *clcw)
{
    clcw->virtual_channel = word >> 18 & 0x3Fu;
    clcw->no_rf = word >> 15 & 1u;
    clcw->no_bit_lock = word >> 14 & 1u;
    clcw->lockout = word >> 13 & 1u;
    clcw->wait = word >> 12 & 1u;
    clcw->retransmit = word >> 11 & 1u;
    clcw->bypasses = word >> 9 & 3u;
    clcw->next = word & 0xFFu;
    return (word >> 29 & 7u) == 0u && (word >> 24 & 3u) == 1u; /* type 0, version 0; COP-1 in effect */
}

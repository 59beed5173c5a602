/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/tm_frame.h"

#include <string.h>

/* ---- reading */

/* The check at the end of a frame, and what stands in front of it. */
static CcsdsFault read_end(const uint8_t *bytes, size_t *n, int control, int check, TmFrame *frame)
{
    if (check) {
        if (ccsds_crc16(bytes, *n) != 0u) {
            return CCSDS_CRC;
        }
        *n -= (size_t)TM_CHECK;
        frame->check = ccsds_get16(bytes + *n);
    } else {
        frame->check = ccsds_crc16(bytes, *n);
    }
    frame->has_control = control != 0;
    frame->control = 0u;
    if (control) {
        *n -= (size_t)TM_CONTROL;
        frame->control = ccsds_get32(bytes + *n);
    }
    return CCSDS_OK;
}

CcsdsFault tm_frame_read(const TmChannel *channel, const uint8_t *bytes, size_t n, TmFrame *frame)
{
    size_t header = TM_FRAME_HEADER;
    if (n != channel->size || n <= header + TM_CONTROL + TM_CHECK) {
        return CCSDS_LENGTH;
    }
    const uint32_t id = ccsds_get16(bytes), status = ccsds_get16(bytes + 4);
    const CcsdsFault fault = read_end(bytes, &n, (int)(id & 1u), channel->check, frame);
    if (fault != CCSDS_OK) {
        return fault;
    }
    if (id >> 14 != 0u) {
        return CCSDS_VERSION;
    }
    frame->spacecraft = id >> 4 & 0x3FFu;
    if (frame->spacecraft != channel->spacecraft) {
        return CCSDS_SPACECRAFT;
    }
    if ((status & 0x4000u) != 0u) {
        return CCSDS_TYPE; /* no packets, but a virtual channel's own data */
    }
    if ((status & 0x8000u) != 0u) {
        header +=
            (size_t)(bytes[TM_FRAME_HEADER] & 0x3Fu) + 1u; /* a secondary header, whose first byte has its length */
        if (header >= n) {
            return CCSDS_LENGTH;
        }
    }
    frame->virtual_channel = id >> 1 & 7u;
    frame->master_count = bytes[2];
    frame->count = bytes[3];
    frame->first = status & 0x7FFu;
    frame->zone = bytes + header;
    frame->n = n - header;
    return CCSDS_OK;
}

CcsdsFault aos_frame_read(const uint8_t *bytes, size_t n, size_t before, int control, int check, TmFrame *frame)
{
    const size_t header = (size_t)AOS_FRAME_HEADER + before + 2u; /* two bytes of it are the M_PDU's */
    if (n <= header + TM_CONTROL + TM_CHECK) {
        return CCSDS_LENGTH;
    }
    const CcsdsFault fault = read_end(bytes, &n, control, check, frame);
    if (fault != CCSDS_OK) {
        return fault;
    }
    const uint32_t id = ccsds_get16(bytes);
    if (id >> 14 != 1u) {
        return CCSDS_VERSION;
    }
    frame->spacecraft = id >> 6 & 0xFFu;
    frame->virtual_channel = id & 0x3Fu;
    frame->master_count = 0u;
    frame->count = ccsds_get24(bytes + 2);
    frame->first = (uint32_t)ccsds_get16(bytes + header - 2) & 0x7FFu;
    frame->zone = bytes + header;
    frame->n = n - header;
    return CCSDS_OK;
}

int tm_receiver_begin(TmReceiver *receiver, uint32_t counts, uint8_t *memory, size_t room, PacketSink sink, void *user)
{
    memset(receiver, 0, sizeof *receiver);
    receiver->counts = counts;
    return packet_zone_begin(&receiver->zone, memory, room, sink, user);
}

void tm_receive(TmReceiver *receiver, const TmFrame *frame)
{
    const uint64_t self = UINT64_C(1) << 40 | (uint64_t)frame->count << 16 | frame->check;
    uint64_t *came = &receiver->came[frame->count % (uint32_t)TM_RECALLED];
    if (receiver->begun != 0u && frame->count != receiver->count) {
        if (*came == self) {
            receiver->repeated++;
            return;
        }
        receiver->missing += (frame->count - receiver->count) & (receiver->counts - 1u);
        packet_zone_gap(&receiver->zone);
    }
    receiver->begun = 1u;
    *came = self;
    receiver->count = (frame->count + 1u) & (receiver->counts - 1u);
    receiver->frames++;
    packet_zone_take(&receiver->zone, frame->zone, frame->n, frame->first);
}

/* ---- sending */

int tm_sender_begin(TmSender *sender, const TmChannel *channel, TmSink sink, void *user)
{
    memset(sender, 0, sizeof *sender);
    sender->channel = *channel;
    sender->sink = sink;
    sender->user = user;
    return channel->spacecraft < 1u << 10 && channel->size <= (uint16_t)TM_FRAME_MAX &&
           channel->size >= (uint16_t)(TM_FRAME_HEADER + TM_CONTROL + TM_CHECK + SPACE_PACKET_MIN);
}

void tm_virtual_begin(TmVirtual *vc, uint8_t number, uint8_t *frame)
{
    memset(vc, 0, sizeof *vc);
    vc->number = number;
    vc->frame = frame;
    vc->first = PACKET_ZONE_NONE;
}

/* [bytes] of packets in a frame of the virtual channel, and where they begin. */
static size_t room(const TmSender *sender, const TmVirtual *vc)
{
    return tm_zone(&sender->channel) - vc->before - vc->behind;
}

static uint8_t *packets(const TmVirtual *vc)
{
    return vc->frame + TM_FRAME_HEADER + vc->before;
}

/* The zone is full: send the frame. */
static void send(TmSender *sender, TmVirtual *vc)
{
    const TmChannel *channel = &sender->channel;
    uint8_t *frame = vc->frame, *zone = frame + TM_FRAME_HEADER, *end = zone + tm_zone(channel);
    const uint32_t first = vc->first;
    vc->n = 0;
    vc->first = PACKET_ZONE_NONE;
    if (vc->protect != NULL && !vc->protect(vc->protector, vc->number, zone, tm_zone(channel))) {
        sender->unprotected++;
        vc->count++; /* the receiver sees that one is missing */
        return;
    }
    ccsds_put16(frame, (uint32_t)channel->spacecraft << 4 | (uint32_t)vc->number << 1 | (channel->control ? 1u : 0u));
    frame[2] = sender->count++;
    frame[3] = vc->count++;
    ccsds_put16(frame + 4, 0x1800u | first);
    if (channel->control) {
        ccsds_put32(end, sender->control);
        end += TM_CONTROL;
    }
    if (channel->check) {
        ccsds_put16(end, ccsds_crc16(frame, (size_t)(end - frame)));
    }
    sender->sink(sender->user, frame, channel->size);
}

void tm_send(TmSender *sender, TmVirtual *vc, const uint8_t *packet, size_t n)
{
    const size_t zone = room(sender, vc);
    if (vc->first == (uint32_t)PACKET_ZONE_NONE) {
        vc->first = (uint32_t)vc->n;
    }
    while (n != 0) {
        const size_t part = zone - vc->n < n ? zone - vc->n : n;
        memcpy(packets(vc) + vc->n, packet, part);
        vc->n += part;
        packet += part;
        n -= part;
        if (vc->n == zone) {
            send(sender, vc);
        }
    }
}

void tm_flush(TmSender *sender, TmVirtual *vc)
{
    uint8_t idle[TM_FRAME_MAX];
    if (vc->n != 0) {
        const size_t left = room(sender, vc) - vc->n;
        const size_t n = left < (size_t)SPACE_PACKET_MIN ? (size_t)SPACE_PACKET_MIN : left;
        space_packet_idle(idle, n);
        tm_send(sender, vc, idle, n);
    }
}

void tm_idle(TmSender *sender, TmVirtual *vc)
{
    if (vc->n == 0) {
        memset(packets(vc), 0x55, room(sender, vc));
        vc->first = PACKET_ZONE_IDLE;
        send(sender, vc);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/space_packet.h"

#include <string.h>

CcsdsFault packet_size(const uint8_t *bytes, size_t n, uint32_t *size)
{
    const size_t header = n != 0 ? packet_header(bytes[0]) : 1u;
    *size = 0u;
    if (header == 0) {
        return CCSDS_VERSION;
    }
    if (n < header) {
        return CCSDS_SHORT;
    }
    if (bytes[0] >> 5 == 0u) {
        *size = (uint32_t)ccsds_get16(bytes + 4) + 7u;
    } else if (header == 1u) {
        *size = packet_is_idle(bytes) ? 1u : 0u;
    } else {
        *size = header == 2u ? bytes[1] : (header == 4u ? ccsds_get16(bytes + 2) : ccsds_get32(bytes + 4));
        *size = *size < header ? 0u : *size;
    }
    return *size == 0u || *size > n ? CCSDS_LENGTH : CCSDS_OK;
}

int packet_is_idle(const uint8_t *bytes)
{
    return bytes[0] >> 5 == (uint32_t)ENCAPSULATION
               ? (bytes[0] & 0x1Cu) == 0u
               : (ccsds_get16(bytes) & (uint32_t)SPACE_PACKET_IDLE) == (uint32_t)SPACE_PACKET_IDLE;
}

void space_packet_idle(uint8_t *bytes, size_t n)
{
    const SpacePacket idle = {(uint32_t)n, SPACE_PACKET_IDLE, 0u, 0u, 0u, SPACE_PACKET_WHOLE};
    space_packet_write(&idle, bytes);
    memset(bytes + SPACE_PACKET_HEADER, 0x55, n - (size_t)SPACE_PACKET_HEADER); /* changes of level for the receiver */
}

CcsdsFault pus_read(PusHeader *header, int command, const uint8_t *bytes, size_t n)
{
    if (n < (size_t)(command ? PUS_COMMAND : PUS_TELEMETRY)) {
        return CCSDS_SHORT;
    }
    if (bytes[0] >> 4 != PUS_VERSION) {
        return CCSDS_VERSION;
    }
    header->flags = bytes[0] & 0xFu;
    header->service = bytes[1];
    header->subtype = bytes[2];
    header->count = command ? 0u : ccsds_get16(bytes + 3);
    header->peer = ccsds_get16(bytes + (command ? 3 : 5));
    return CCSDS_OK;
}

size_t pus_write(const PusHeader *header, int command, uint8_t *bytes)
{
    bytes[0] = (uint8_t)((uint32_t)PUS_VERSION << 4 | (header->flags & 0xFu));
    bytes[1] = header->service;
    bytes[2] = header->subtype;
    if (command) {
        ccsds_put16(bytes + 3, header->peer);
        return PUS_COMMAND;
    }
    ccsds_put16(bytes + 3, header->count);
    ccsds_put16(bytes + 5, header->peer);
    return PUS_TELEMETRY;
}

size_t packet_split(PacketSplitter *splitter, uint8_t *bytes)
{
    SpacePacket *head = &splitter->head;
    if (splitter->n == 0) {
        return 0;
    }
    const size_t n = splitter->n < splitter->room ? splitter->n : splitter->room;
    const int first = head->part != (uint8_t)SPACE_PACKET_MIDDLE, last = n == splitter->n;
    head->part = (uint8_t)(first ? (last ? SPACE_PACKET_WHOLE : SPACE_PACKET_FIRST)
                                 : (last ? SPACE_PACKET_LAST : SPACE_PACKET_MIDDLE));
    head->size = (uint32_t)(SPACE_PACKET_HEADER + n);
    space_packet_write(head, bytes);
    memcpy(bytes + SPACE_PACKET_HEADER, splitter->data, n);
    splitter->data += n;
    splitter->n -= n;
    head->part = (uint8_t)(last ? SPACE_PACKET_WHOLE : SPACE_PACKET_MIDDLE);
    head->count = (uint16_t)(head->count + 1u) & 0x3FFFu;
    return head->size;
}

int part_join(PartJoiner *joiner, uint32_t part, const uint8_t *data, size_t n, CcsdsFault unfinished)
{
    const int first = (part & SPACE_PACKET_FIRST) != 0u, last = (part & SPACE_PACKET_LAST) != 0u;
    if (first) {
        if (joiner->open != 0u) {
            joiner->faults[unfinished]++;
        }
        joiner->open = 1u;
        joiner->n = 0;
    } else if (joiner->open == 0u) {
        joiner->faults[CCSDS_STRAY]++;
        return 0;
    }
    if (n > joiner->room - joiner->n) {
        joiner->faults[CCSDS_ROOM]++;
        joiner->open = 0u;
        return 0;
    }
    memcpy(joiner->memory + joiner->n, data, n);
    joiner->n += n;
    joiner->open = !last;
    return last;
}

void packet_joiner_begin(PacketJoiner *joiner, uint16_t application, uint8_t *memory, size_t room)
{
    memset(joiner, 0, sizeof *joiner);
    joiner->application = application;
    joiner->parts.memory = memory;
    joiner->parts.room = room;
}

int packet_join(PacketJoiner *joiner, const uint8_t *bytes, size_t n)
{
    SpacePacket packet;
    CcsdsFault fault = space_packet_read(&packet, bytes, n);
    if (fault == CCSDS_OK && packet.size != n) {
        fault = CCSDS_LENGTH;
    }
    if (fault == CCSDS_OK && packet.application != joiner->application) {
        fault = CCSDS_CHANNEL;
    }
    if (fault != CCSDS_OK) {
        joiner->parts.faults[fault]++;
        return 0;
    }
    const uint16_t check = ccsds_crc16(bytes, n);
    if (joiner->begun != 0u && packet.count != joiner->count) {
        if (((packet.count + 1u) & 0x3FFFu) == joiner->count && check == joiner->check) {
            joiner->parts.faults[CCSDS_REPLAY]++;
            return 0;
        }
        joiner->parts.faults[CCSDS_GAP]++;
        joiner->parts.open = 0u;
    }
    joiner->begun = 1u;
    joiner->check = check;
    joiner->count = (uint16_t)(packet.count + 1u) & 0x3FFFu;
    return part_join(&joiner->parts, packet.part, bytes + SPACE_PACKET_HEADER, n - (size_t)SPACE_PACKET_HEADER,
                     CCSDS_TYPE); /* no packet is missing, so the sender left out the last part */
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Space packets (CCSDS 133.0-B-2), and the sizes of encapsulation packets (133.1-B-3), which may stand between them.
 *
 *     byte 0  version (3 bits, 0), 1 for a command, 1 with a secondary header, application (11 bits)
 *          2  part (2 bits), count of the application's packets (14 bits)
 *          4  length of what follows, minus 1
 *          6  the secondary header, if there is one, and the data
 *
 * Example:
 *
 *     uint8_t bytes[SPACE_PACKET_HEADER + 4] = {0};
 *     const SpacePacket command = {
 *         .size = sizeof bytes, .application = 42, .count = 7, .command = 1, .part = SPACE_PACKET_WHOLE};
 *     space_packet_write(&command, bytes);
 *     SpacePacket header;
 *     if (space_packet_read(&header, bytes, sizeof bytes) == CCSDS_OK && header.application == 42) {
 *         // its data are the header.size - SPACE_PACKET_HEADER bytes behind the header
 *     }
 */
#ifndef CCSDS_SPACE_PACKET_H
#define CCSDS_SPACE_PACKET_H

#include "ccsds/bytes.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SPACE_PACKET_HEADER = 6,   ///< [bytes]
    SPACE_PACKET_MIN = 7,      ///< [bytes]
    SPACE_PACKET_MAX = 65542,  ///< [bytes]
    SPACE_PACKET_IDLE = 0x7FF, ///< the application of idle packets, which fill
    SPACE_PACKET_COUNTS = 1 << 14
};

/** Which part of a longer unit of data a packet, or a segment of a telecommand, carries. Both use these numbers. */
typedef enum SpacePacketPart {
    SPACE_PACKET_MIDDLE = 0,
    SPACE_PACKET_FIRST = 1,
    SPACE_PACKET_LAST = 2,
    SPACE_PACKET_WHOLE = 3
} SpacePacketPart;

/** A header. */
typedef struct SpacePacket {
    uint32_t size; ///< [bytes] of the whole packet
    uint16_t application;
    uint16_t count;
    uint8_t command;   ///< 1: to the spacecraft; 0: from it
    uint8_t secondary; ///< 1: there is a secondary header
    uint8_t part;      ///< SpacePacketPart
} SpacePacket;

/** Read the header of the packet with which n bytes begin. CCSDS_SHORT: fewer than a header; CCSDS_VERSION;
 * CCSDS_LENGTH: the packet is longer than n, and `packet` is filled all the same. */
static inline CcsdsFault space_packet_read(SpacePacket *packet, const uint8_t *bytes, size_t n)
{
    if (n < (size_t)SPACE_PACKET_HEADER) {
        return CCSDS_SHORT;
    }
    const uint32_t id = ccsds_get16(bytes), sequence = ccsds_get16(bytes + 2);
    if (id >> 13 != 0u) {
        return CCSDS_VERSION;
    }
    packet->command = id >> 12 & 1u;
    packet->secondary = id >> 11 & 1u;
    packet->application = id & 0x7FFu;
    packet->part = (uint8_t)(sequence >> 14);
    packet->count = sequence & 0x3FFFu;
    packet->size = (uint32_t)ccsds_get16(bytes + 4) + 7u;
    return packet->size > n ? CCSDS_LENGTH : CCSDS_OK;
}

enum {
    ENCAPSULATION = 7, ///< the version of encapsulation packets: the first 3 bits
    ENCAPSULATION_HEADER_MAX = 8
};

/** [bytes] of the header of the packet that begins with this byte; 0: of another version.
 *
 * An encapsulation packet has the version (3 bits), the protocol in it (3 bits; 0: it fills) and the size of its header
 * (2 bits: 1, 2, 4 or 8 bytes), which ends with the length of the whole packet. */
static inline size_t packet_header(uint32_t first)
{
    return first >> 5 == 0u ? (size_t)SPACE_PACKET_HEADER
                            : (first >> 5 == (uint32_t)ENCAPSULATION ? (size_t)1u << (first & 3u) : 0u);
}

/** The size of the packet, of either version, with which n bytes begin. CCSDS_SHORT: fewer than a header;
 * CCSDS_VERSION; CCSDS_LENGTH: it is longer than n, or has size 0 because it says that it is shorter than its header.
 * One whose header is a single byte is an idle one. */
CcsdsFault packet_size(const uint8_t *bytes, size_t n, uint32_t *size);

/** Whether a whole packet fills alone. */
int packet_is_idle(const uint8_t *bytes);

/** Write a header: 6 bytes. */
static inline void space_packet_write(const SpacePacket *packet, uint8_t *bytes)
{
    ccsds_put16(bytes, (packet->command & 1u) << 12 | (packet->secondary & 1u) << 11 | (packet->application & 0x7FFu));
    ccsds_put16(bytes + 2, (uint32_t)packet->part << 14 | (packet->count & 0x3FFFu));
    ccsds_put16(bytes + 4, packet->size - 7u);
}

enum {
    PUS_VERSION = 2,
    PUS_COMMAND = 5,  ///< [bytes] of a command's secondary header, without spare bytes
    PUS_TELEMETRY = 7 ///< [bytes] of telemetry's, without the time and spare bytes
};

/** A secondary header of PUS-C (ECSS-E-ST-70-41C, 7.4). A command has its source behind the subtype; telemetry has the
 * count, the destination, and then the time of a length that the mission knows (time_code.h). */
typedef struct PusHeader {
    uint8_t flags; ///< 4 bits: the reports that a command asks for; the status of telemetry's time
    uint8_t service;
    uint8_t subtype;
    uint16_t count; ///< of messages of this type; a command has none
    uint16_t peer;  ///< the source of a command, the destination of telemetry
} PusHeader;

/** Read the header with which the n bytes behind the primary header begin. CCSDS_SHORT; CCSDS_VERSION: not that of
 * PUS-C. */
CcsdsFault pus_read(PusHeader *header, int command, const uint8_t *bytes, size_t n);

/** Write a header. Returns its size: PUS_COMMAND or PUS_TELEMETRY. */
size_t pus_write(const PusHeader *header, int command, uint8_t *bytes);

/** Write an idle packet of n bytes, SPACE_PACKET_MIN to SPACE_PACKET_MAX. */
void space_packet_idle(uint8_t *bytes, size_t n);

/** Data that is longer than a packet, packet by packet. */
typedef struct PacketSplitter {
    SpacePacket head; ///< of the next packet; its count goes on
    const uint8_t *data;
    size_t n;    ///< [bytes] of data that are left
    size_t room; ///< [bytes] of data in a packet, at least 1
} PacketSplitter;

/** Write the next packet, of at most SPACE_PACKET_HEADER + room bytes. Returns its size, 0 after the last. */
size_t packet_split(PacketSplitter *splitter, uint8_t *bytes);

/** Joins the parts of units of data again. */
typedef struct PartJoiner {
    uint8_t *memory;
    size_t room;  ///< [bytes] of it
    size_t n;     ///< [bytes] that are there
    uint8_t open; ///< 1: a first part came
    uint32_t faults[CCSDS_FAULTS];
} PartJoiner;

/** Take n bytes, a SpacePacketPart of a unit. unfinished: the fault to count where a unit begins before the last part
 * of the one before came. Returns 1 if the unit is whole: joiner->n bytes in joiner->memory. */
int part_join(PartJoiner *joiner, uint32_t part, const uint8_t *data, size_t n, CcsdsFault unfinished);

/** Joins the packets of one application again. */
typedef struct PacketJoiner {
    PartJoiner parts;
    uint16_t application;
    uint16_t count; ///< of the next packet
    uint16_t check; ///< the CRC of the last one
    uint8_t begun;  ///< 1: a packet came, so the count is known
} PacketJoiner;

void packet_joiner_begin(PacketJoiner *joiner, uint16_t application, uint8_t *memory, size_t room);

/** Take a packet. Returns 1 if the data is whole, as part_join does. What is missing or too long is counted in
 * joiner->parts.faults, and ends the data that it belongs to. A packet that is the last one again counts as
 * CCSDS_REPLAY, and is passed over. */
int packet_join(PacketJoiner *joiner, const uint8_t *packet, size_t n);

#ifdef __cplusplus
}
#endif

#endif

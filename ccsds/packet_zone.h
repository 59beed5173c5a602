/* SPDX-License-Identifier: Apache-2.0 */
/* Packets that follow one another through the data fields of frames and span them: the packet service of TM frames
 * (132.0-B-3) and the M_PDU of AOS frames (732.0-B-4), whose first header pointer is the same. */
#ifndef CCSDS_PACKET_ZONE_H
#define CCSDS_PACKET_ZONE_H

#include "ccsds/space_packet.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    PACKET_ZONE_IDLE = 0x7FE, ///< first header pointer: the zone has idle data alone
    PACKET_ZONE_NONE = 0x7FF  ///< first header pointer: no packet begins in the zone
};

typedef void (*PacketSink)(void *user, const uint8_t *packet, size_t n);

/** Takes packets out of zones. Idle packets are dropped; encapsulation packets go to a function of their own. */
typedef struct PacketZone {
    uint8_t *memory; ///< for the packet that is not whole yet
    size_t room;     ///< [bytes] of it
    size_t n;        ///< [bytes] of the packet that are there
    size_t skip;     ///< [bytes] still to come of a packet for which there is no room
    uint8_t synced;  ///< 1: the next byte of a zone belongs to the packet
    PacketSink sink;
    PacketSink encapsulation; ///< NULL: they are counted alone
    void *user;
    uint32_t packets;
    uint32_t encapsulated; ///< encapsulation packets, without idle ones
    uint32_t idle;         ///< packets that fill, of both kinds
    uint32_t
        faults[CCSDS_FAULTS]; ///< GAP: packets cut off by a missing frame; ROOM; LENGTH: a packet ends elsewhere than
                              ///< where the pointer says; VERSION; STRAY: zones from which nothing could be used
} PacketZone;

/** Returns 0 if the memory has no room for a header, ENCAPSULATION_HEADER_MAX bytes; each zone then counts as ROOM. */
int packet_zone_begin(PacketZone *zone, uint8_t *memory, size_t room, PacketSink sink, void *user);

/** Frames before the next one are missing. */
void packet_zone_gap(PacketZone *zone);

/** Take a zone. first: its first header pointer. */
void packet_zone_take(PacketZone *zone, const uint8_t *bytes, size_t n, uint32_t first);

#ifdef __cplusplus
}
#endif

#endif

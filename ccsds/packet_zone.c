/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/packet_zone.h"

#include <string.h>

int packet_zone_begin(PacketZone *zone, uint8_t *memory, size_t room, PacketSink sink, void *user)
{
    memset(zone, 0, sizeof *zone);
    zone->memory = memory;
    zone->room = room;
    zone->sink = sink;
    zone->user = user;
    return room >= (size_t)ENCAPSULATION_HEADER_MAX;
}

/* Give up the packet that is not whole. */
static void drop(PacketZone *zone, CcsdsFault fault)
{
    if (zone->n + zone->skip != 0) {
        zone->faults[fault]++;
    }
    zone->n = zone->skip = 0;
    zone->synced = 0u;
}

void packet_zone_gap(PacketZone *zone)
{
    drop(zone, CCSDS_GAP);
}

static void deliver(PacketZone *zone, const uint8_t *bytes, size_t n)
{
    if (packet_is_idle(bytes)) {
        zone->idle++;
    } else if (bytes[0] >> 5 == 0u) {
        zone->packets++;
        zone->sink(zone->user, bytes, n);
    } else {
        zone->encapsulated++;
        if (zone->encapsulation != NULL) {
            zone->encapsulation(zone->user, bytes, n);
        }
    }
}

/* Take n bytes of packets that follow one another. Returns 0 if a header is wrong: nothing more can be found. */
static int follow(PacketZone *zone, const uint8_t *bytes, size_t n)
{
    while (n != 0) {
        if (zone->skip != 0) {
            const size_t part = zone->skip < n ? zone->skip : n;
            zone->skip -= part;
            bytes += part;
            n -= part;
            continue;
        }
        uint32_t size = 0u;
        if (zone->n == 0 && packet_size(bytes, n, &size) == CCSDS_OK) { /* whole: no copy */
            deliver(zone, bytes, size);
            bytes += size;
            n -= size;
            continue;
        }
        /* The first byte, then the header, then the rest. */
        size_t wanted = zone->n == 0 ? 1u : packet_header(zone->memory[0]);
        if (zone->n != 0 && zone->n >= wanted) {
            (void)packet_size(zone->memory, zone->n, &size);
            wanted = size;
        }
        const size_t part = wanted - zone->n < n ? wanted - zone->n : n;
        memcpy(zone->memory + zone->n, bytes, part);
        zone->n += part;
        bytes += part;
        n -= part;
        if (zone->n < wanted) {
            continue;
        }
        const CcsdsFault fault = packet_size(zone->memory, zone->n, &size);
        if (fault == CCSDS_OK) {
            zone->n = 0;
            deliver(zone, zone->memory, size);
        } else if (fault == CCSDS_VERSION || (fault == CCSDS_LENGTH && size == 0u)) {
            drop(zone, fault);
            return 0;
        } else if (size > zone->room) {
            zone->faults[CCSDS_ROOM]++;
            zone->skip = size - zone->n;
            zone->n = 0;
        }
    }
    return 1;
}

void packet_zone_take(PacketZone *zone, const uint8_t *bytes, size_t n, uint32_t first)
{
    if (zone->room < (size_t)ENCAPSULATION_HEADER_MAX) { /* a header goes into memory before its length is known */
        zone->faults[CCSDS_ROOM]++;
        return;
    }
    if (first == (uint32_t)PACKET_ZONE_IDLE) {
        drop(zone, CCSDS_LENGTH);
        return;
    }
    if (first != (uint32_t)PACKET_ZONE_NONE && first >= n) {
        drop(zone, CCSDS_LENGTH);
        zone->faults[CCSDS_STRAY]++;
        return;
    }
    const size_t rest = first == (uint32_t)PACKET_ZONE_NONE ? n : first;
    int good = 1;
    if (zone->synced != 0u) {
        good = follow(zone, bytes, rest);
    } else if (rest == n) {
        zone->faults[CCSDS_STRAY]++;
    }
    if (rest == n) {
        return;
    }
    if (good && zone->n + zone->skip != 0) {
        drop(zone, CCSDS_LENGTH); /* its end should have come */
    }
    zone->synced = 1u;
    (void)follow(zone, bytes + rest, n - rest);
}

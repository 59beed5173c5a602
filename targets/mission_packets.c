/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_packets.h"

#include "registers/field.h"

#include <string.h>

static const RegisterLane *lane_of(const MissionIo *io, const MissionLane *row)
{
    return &io->boards[row->board]->lanes[row->lane];
}

/* The kind of the packets with a tag in a lane; NULL: there is none. */
static const MissionPacket *kind_of(const MissionPackets *packets, uint16_t board, uint16_t lane, uint32_t tag)
{
    for (uint32_t i = 0u; i < packets->n; i++) {
        const MissionPacket *kind = &packets->kinds[i];
        if (kind->board == board && kind->lane == lane && kind->tag == tag) {
            return kind;
        }
    }
    return 0;
}

/* The kind of packets that a row is a part of; NULL: a whole message, plain words, or beyond the last row. */
static const MissionPacket *packet_of(const MissionIo *io, uint32_t i)
{
    const MissionLane *row = &io->lanes[i];
    return i < io->n_lanes && !row->type
               ? kind_of(io->packets, row->board, row->lane, lane_of(io, row)->fields[row->field].tag)
               : NULL;
}

/* ---- numbers */

static void put_numbers(const RegisterLane *lane, const MissionLane *row, const MissionPacket *packet,
                        const uint8_t *message, MissionIoCounts *counts)
{
    const RegisterField *field = &lane->fields[row->field];
    const uint8_t *p = message + row->offset;
    if (lane->form == REGISTER_WORD) {
        int saturated = 0;
        uint32_t word;
        memcpy(&word, packet->memory, sizeof word);
        word =
            register_field_place(field, word, register_field_quantise(field, element_read(row->number, p), &saturated));
        memcpy(packet->memory, &word, sizeof word);
        counts->saturated += saturated != 0;
        return;
    }
    for (uint32_t i = 0u; i < field->count; i++, p += element_size(row->number)) {
        counts->saturated += register_field_write(field, packet->memory, i, element_read(row->number, p)) != 0;
    }
}

static void take_numbers(const RegisterLane *lane, const MissionLane *row, const MissionPacket *packet,
                         uint8_t *message)
{
    const RegisterField *field = &lane->fields[row->field];
    uint8_t *p = message + row->offset;
    if (lane->form == REGISTER_WORD) {
        uint32_t word;
        memcpy(&word, packet->memory, sizeof word);
        element_write(row->number, p, register_field_value(field, register_field_count(field, word)));
        return;
    }
    for (uint32_t i = 0u; i < field->count; i++, p += element_size(row->number)) {
        element_write(row->number, p, register_field_read(field, packet->memory, i));
    }
}

/* ---- packets */

/* A packet begins with the header that the outside's end adds for flight. */
static void begin_packet(const MissionPacket *packet, const RegisterLane *lane)
{
    memset(packet->memory, 0, packet->size);
    if ((lane->flags & REGISTER_FROM_FLIGHT) == 0u && lane->outside.add != 0u) {
        memcpy(packet->memory, lane->outside.head, lane->outside.add);
    }
}

static void end_packet(const RegisterWindow *w, const MissionPacket *packet, const RegisterLane *lane,
                       MissionIoCounts *counts)
{
    RegisterStatus status;
    if (lane->form == REGISTER_WORD) {
        uint32_t word;
        memcpy(&word, packet->memory, sizeof word);
        status = register_put_word(w, lane, 0u, word);
    } else {
        status = register_put(w, lane, packet->memory, packet->size, packet->tag);
    }
    counts->refused += status != REGISTER_OK;
}

/* Take the next packet of a lane into io->packets->scratch. */
static RegisterStatus take_packet(const MissionIo *io, const RegisterWindow *w, const RegisterLane *lane,
                                  RegisterInfo *info)
{
    if (lane->form != REGISTER_WORD) {
        return register_take(w, lane, io->packets->scratch, lane->capacity, info);
    }
    uint32_t word = 0u;
    const RegisterStatus status = register_take_word(w, lane, 0u, &word);
    memcpy(io->packets->scratch, &word, sizeof word);
    *info = (RegisterInfo){sizeof word, 0u, 0u};
    return status;
}

/* Keep the packet in io->packets->scratch as the last of its kind. */
static void keep_packet(const MissionIo *io, const MissionPacket *kind, const RegisterLane *lane,
                        const RegisterInfo *info, MissionIoCounts *counts)
{
    const uint32_t add = (lane->flags & REGISTER_FROM_FLIGHT) == 0u ? lane->outside.add : 0u;
    if (!kind || info->n < kind->size || (add != 0u && memcmp(io->packets->scratch, lane->outside.head, add) != 0)) {
        counts->corrupt++; /* of no known kind, too short, or without its header */
        return;
    }
    counts->skipped += kind->memory[kind->size];
    memcpy(kind->memory, io->packets->scratch, kind->size);
    kind->memory[kind->size] = 1u;
}

/* Whether the next packet of a queue must wait: one of its kind has not been seen yet, and a reader sees each. */
static int must_wait(const MissionIo *io, const RegisterWindow *w, const MissionPacket *packet,
                     const RegisterLane *lane)
{
    uint32_t tag;
    if (packet->newest != 0u || lane->form == REGISTER_WORD || (lane->flags & REGISTER_QUEUED) == 0u ||
        register_next_tag(w, lane, &tag) != REGISTER_OK) {
        return 0;
    }
    const MissionPacket *kind = kind_of(io->packets, packet->board, packet->lane, tag);
    return kind && kind->memory[kind->size] != 0u;
}

/* Whether there is a packet of this kind that was not seen; it is seen then. Others of its lane that come before it are
 * kept for their own messages. */
static int fetch_packet(const MissionIo *io, const RegisterWindow *w, const MissionPacket *packet,
                        MissionIoCounts *counts)
{
    const RegisterLane *lane = &io->boards[packet->board]->lanes[packet->lane];
    uint8_t *fresh = &packet->memory[packet->size];
    w += packet->board;
    for (uint32_t k = 0u; k <= lane->depth && (*fresh == 0u || packet->newest != 0u); k++) {
        RegisterInfo info;
        if (must_wait(io, w, packet, lane)) {
            break;
        }
        const RegisterStatus status = take_packet(io, w, lane, &info);
        if (status == REGISTER_OK) {
            keep_packet(io, kind_of(io->packets, packet->board, packet->lane, info.tag), lane, &info, counts);
        } else if (status == REGISTER_CORRUPT || status == REGISTER_SIZE) {
            counts->corrupt++;
        } else {
            break; /* empty; or the last one again; or the writer is faster */
        }
    }
    const int ready = *fresh != 0u;
    *fresh = 0u;
    return ready;
}

static void forget(const MissionIo *io, const RegisterWindow *w)
{
    for (uint32_t i = 0u; i < io->packets->n; i++) {
        const MissionPacket *packet = &io->packets->kinds[i];
        const RegisterLane *lane = &io->boards[packet->board]->lanes[packet->lane];
        RegisterInfo info;
        packet->memory[packet->size] = 0u;
        for (uint32_t k = 0u; w && k <= lane->depth && (lane->flags & REGISTER_FROM_FLIGHT) == 0u; k++) {
            if (take_packet(io, w + packet->board, lane, &info) == REGISTER_EMPTY) {
                break;
            }
        }
    }
}

static uint32_t lost_packets(const MissionIo *io, const RegisterWindow *w)
{
    uint32_t lost = 0u;
    for (uint32_t i = 0u; i < io->packets->n; i++) {
        const MissionPacket *p = &io->packets->kinds[i];
        if (i == 0u || p[-1].board != p->board || p[-1].lane != p->lane) {
            lost += register_lost(w + p->board, &io->boards[p->board]->lanes[p->lane]);
        }
    }
    return lost;
}

/* ---- rows */

static uint32_t put_rows(const MissionIo *io, const RegisterWindow *w, uint32_t i, const uint8_t *message,
                         MissionIoCounts *counts)
{
    const MissionLane *first = &io->lanes[i];
    const MissionPacket *packet = packet_of(io, i);
    if (packet) {
        const RegisterLane *lane = lane_of(io, first);
        begin_packet(packet, lane);
        for (; packet_of(io, i) == packet && io->lanes[i].message == first->message; i++) {
            put_numbers(lane, &io->lanes[i], packet, message, counts);
        }
        end_packet(w + first->board, packet, lane, counts);
    }
    return i;
}

static uint32_t take_rows(const MissionIo *io, const RegisterWindow *w, uint32_t i, uint8_t *message, int64_t t,
                          int *headed, MissionIoCounts *counts)
{
    const MissionLane *first = &io->lanes[i];
    const MissionPacket *packet = packet_of(io, i);
    if (packet) {
        const int fetched = fetch_packet(io, w, packet, counts);
        if (fetched && !*headed) {
            mission_io_head(message, t);
            *headed = 1;
        }
        for (; packet_of(io, i) == packet && io->lanes[i].message == first->message; i++) {
            if (fetched) {
                take_numbers(lane_of(io, first), &io->lanes[i], packet, message);
            }
        }
    }
    return i;
}

const MissionPacketFunctions mission_packet_functions = {put_rows, take_rows, forget, lost_packets};

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_io.h"

#include "registers/field.h"

#include <string.h>

static const RegisterLane *lane_of(const MissionIo *io, const MissionLane *row)
{
    return &io->boards[row->board]->lanes[row->lane];
}

/* ---- one row of the table */

/* The kind of packets that a row is a part of; NULL: a whole message, or plain words. */
static const MissionPacket *packet_of(const MissionIo *io, const MissionLane *row)
{
    for (uint32_t i = 0u; !row->type && i < io->n_packets; i++) {
        const MissionPacket *p = &io->packets[i];
        if (p->board == row->board && p->lane == row->lane && p->tag == lane_of(io, row)->fields[row->field].tag) {
            return p;
        }
    }
    return 0;
}

static void put_row(const MissionIo *io, const RegisterWindow *w, const MissionLane *row, const MissionPacket *packet,
                    const uint8_t *message, MissionIoCounts *counts)
{
    const RegisterLane *lane = lane_of(io, row);
    w += row->board;
    if (row->type) {
        counts->refused += register_put_message(w, lane, row->type, message) != REGISTER_OK;
        return;
    }
    const RegisterField *field = &lane->fields[row->field];
    const uint8_t *p = message + row->offset;
    if (lane->form == REGISTER_PACKET) {
        for (uint32_t i = 0u; i < field->count; i++, p += element_size(row->number)) {
            counts->saturated += register_field_write(field, packet->memory, i, element_read(row->number, p)) != 0;
        }
        return;
    }
    for (uint32_t i = 0u; i < lane->count; i++, p += element_size(row->number)) {
        int saturated = 0;
        uint32_t word = 0u;
        const int64_t count = register_field_quantise(field, element_read(row->number, p), &saturated);
        counts->saturated += saturated != 0;
        if (packet) {
            memcpy(&word, packet->memory, sizeof word);
            word = register_field_place(field, word, count);
            memcpy(packet->memory, &word, sizeof word);
        } else {
            (void)register_take_word(w, lane, i, &word); /* to keep the other fields of the word */
            (void)register_put_word(w, lane, i, register_field_place(field, word, count));
        }
    }
}

static void take_row(const MissionIo *io, const RegisterWindow *w, const MissionLane *row, const MissionPacket *packet,
                     uint8_t *message, MissionIoCounts *counts)
{
    const RegisterLane *lane = lane_of(io, row);
    w += row->board;
    if (row->type) {
        RegisterInfo info;
        const RegisterStatus status = register_take_message(w, lane, row->type, message, &info);
        if (status == REGISTER_CORRUPT) {
            memset(message, 0, row->type->size); /* the invalid bytes may have overwritten it */
        }
        counts->corrupt += status == REGISTER_CORRUPT || status == REGISTER_SIZE;
        return;
    }
    const RegisterField *field = &lane->fields[row->field];
    uint8_t *p = message + row->offset;
    if (lane->form == REGISTER_PACKET) {
        for (uint32_t i = 0u; i < field->count; i++, p += element_size(row->number)) {
            element_write(row->number, p, register_field_read(field, packet->memory, i));
        }
        return;
    }
    for (uint32_t i = 0u; i < lane->count; i++, p += element_size(row->number)) {
        uint32_t word = 0u;
        if (packet) {
            memcpy(&word, packet->memory, sizeof word);
        } else {
            (void)register_take_word(w, lane, i, &word);
        }
        element_write(row->number, p, register_field_value(field, register_field_count(field, word)));
    }
}

/* Write the head of a message that passes in words or packets. Rows of head fields replace these values afterwards.
 * With t < 0 the message stays as if never written. */
static void write_head(uint8_t *message, int64_t t)
{
    Head head;
    memcpy(&head, message, sizeof head);
    head = head_next(head, t, QUALITY_GOOD);
    memcpy(message, &head, sizeof head);
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

/* Take the next packet of a lane into io->scratch. */
static RegisterStatus take_packet(const MissionIo *io, const RegisterWindow *w, const RegisterLane *lane,
                                  RegisterInfo *info)
{
    if (lane->form != REGISTER_WORD) {
        return register_take(w, lane, io->scratch, lane->capacity, info);
    }
    uint32_t word = 0u;
    const RegisterStatus status = register_take_word(w, lane, 0u, &word);
    memcpy(io->scratch, &word, sizeof word);
    *info = (RegisterInfo){sizeof word, 0u, 0u};
    return status;
}

/* The kind of a packet with this tag in the same lane as another kind; NULL: unknown. */
static const MissionPacket *kind_of(const MissionIo *io, const MissionPacket *other, uint32_t tag)
{
    for (uint32_t i = 0u; i < io->n_packets; i++) {
        const MissionPacket *p = &io->packets[i];
        if (p->board == other->board && p->lane == other->lane && p->tag == tag) {
            return p;
        }
    }
    return 0;
}

/* Keep the packet in io->scratch as the last of its kind. */
static void keep_packet(const MissionIo *io, const MissionPacket *kind, const RegisterLane *lane,
                        const RegisterInfo *info, MissionIoCounts *counts)
{
    const uint32_t add = (lane->flags & REGISTER_FROM_FLIGHT) == 0u ? lane->outside.add : 0u;
    if (!kind || info->n < kind->size || (add != 0u && memcmp(io->scratch, lane->outside.head, add) != 0)) {
        counts->corrupt++; /* of no known kind, too short, or without its header */
        return;
    }
    counts->skipped += kind->memory[kind->size];
    memcpy(kind->memory, io->scratch, kind->size);
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
    const MissionPacket *kind = kind_of(io, packet, tag);
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
            keep_packet(io, kind_of(io, packet, info.tag), lane, &info, counts);
        } else if (status == REGISTER_CORRUPT || status == REGISTER_SIZE) {
            counts->corrupt++;
        } else {
            break; /* empty; or the last one again; or the writer is faster */
        }
    }
    const int found = *fresh != 0u;
    *fresh = 0u;
    return found;
}

void mission_io_forget(const MissionIo *io, const RegisterWindow *w)
{
    for (uint32_t i = 0u; i < io->n_packets; i++) {
        const MissionPacket *packet = &io->packets[i];
        const RegisterLane *lane = &io->boards[packet->board]->lanes[packet->lane];
        RegisterInfo info;
        packet->memory[packet->size] = 0u;
        for (uint32_t k = 0u; k <= lane->depth && (lane->flags & REGISTER_FROM_FLIGHT) == 0u; k++) {
            if (take_packet(io, w + packet->board, lane, &info) == REGISTER_EMPTY) {
                break;
            }
        }
    }
}

uint32_t mission_io_lost(const MissionIo *io, const RegisterWindow *w)
{
    uint32_t lost = 0u;
    for (uint32_t i = 0u; i < io->n_packets; i++) {
        const MissionPacket *p = &io->packets[i];
        if (i == 0u || p[-1].board != p->board || p[-1].lane != p->lane) {
            lost += register_lost(w + p->board, &io->boards[p->board]->lanes[p->lane]);
        }
    }
    return lost;
}

/* ---- one message: the rows from i on, up to the first of another message, which is returned */

static uint32_t put_message(const MissionIo *io, const RegisterWindow *w, uint32_t i, const uint8_t *message,
                            MissionIoCounts *counts)
{
    const uint16_t id = io->lanes[i].message;
    const MissionPacket *open = 0;
    for (; i < io->n_lanes && io->lanes[i].message == id; i++) {
        const MissionLane *row = &io->lanes[i];
        const MissionPacket *packet = packet_of(io, row);
        if (packet && packet != open) {
            begin_packet(packet, lane_of(io, row));
        }
        open = packet;
        put_row(io, w, row, packet, message, counts);
        if (packet && (i + 1u == io->n_lanes || io->lanes[i + 1u].message != id || packet_of(io, row + 1) != packet)) {
            end_packet(w + row->board, packet, lane_of(io, row), counts);
        }
    }
    return i;
}

static uint32_t take_message(const MissionIo *io, const RegisterWindow *w, uint32_t i, uint8_t *message, int64_t t,
                             MissionIoCounts *counts)
{
    const uint16_t id = io->lanes[i].message;
    const MissionPacket *open = 0;
    int found = 0, headed = 0;
    for (; i < io->n_lanes && io->lanes[i].message == id; i++) {
        const MissionLane *row = &io->lanes[i];
        const MissionPacket *packet = packet_of(io, row);
        if (packet && packet != open) {
            found = fetch_packet(io, w, packet, counts);
        }
        open = packet;
        if (packet && !found) {
            continue;
        }
        if (!row->type && !headed && t >= 0) {
            write_head(message, t);
            headed = 1;
        }
        take_row(io, w, row, packet, message, counts);
    }
    return i;
}

/* ---- flight */

uint32_t mission_io_clock(const MissionIo *io)
{
    uint32_t i = 0u;
    while (i < io->n_boards && io->boards[i]->clock == REGISTER_NOWHERE) {
        i++;
    }
    return i;
}

void mission_io_read(const MissionIo *io, const RegisterWindow *w, void *mission, int64_t t, MissionIoCounts *counts)
{
    for (uint32_t i = 0u; i < io->n_lanes;) {
        const MissionLane *row = &io->lanes[i];
        if (io->messages[row->message].direction == MISSION_IN) {
            i = take_message(io, w, i, (uint8_t *)mission + io->messages[row->message].offset, t, counts);
        } else {
            i++;
        }
    }
}

void mission_io_write(const MissionIo *io, const RegisterWindow *w, const void *mission, MissionIoCounts *counts)
{
    for (uint32_t i = 0u; i < io->n_lanes;) {
        const MissionLane *row = &io->lanes[i];
        if (io->messages[row->message].direction != MISSION_IN) {
            const MissionMessage *m = &io->messages[row->message];
            i = put_message(io, w, i, (const uint8_t *)mission + m->offset, counts);
        } else {
            i++;
        }
    }
}

/* ---- packets */

uint32_t mission_io_receive(const MissionIo *io, const RegisterWindow *w, MissionQueue queue, void *packet,
                            uint32_t room, MissionIoCounts *counts)
{
    RegisterInfo info;
    if (queue.board == MISSION_NO_BOARD) {
        return 0u;
    }
    const RegisterStatus status =
        register_take(&w[queue.board], &io->boards[queue.board]->lanes[queue.lane], packet, room, &info);
    counts->corrupt += status == REGISTER_CORRUPT || status == REGISTER_SIZE;
    return status == REGISTER_OK ? info.n : 0u;
}

int mission_io_send(const MissionIo *io, const RegisterWindow *w, MissionQueue queue, const void *packet, uint32_t n,
                    MissionIoCounts *counts)
{
    if (queue.board == MISSION_NO_BOARD) {
        return 0;
    }
    const int sent =
        register_put(&w[queue.board], &io->boards[queue.board]->lanes[queue.lane], packet, n, 0u) == REGISTER_OK;
    counts->refused += sent == 0;
    return sent;
}

/* ---- outside */

/* The first row of a message; n_lanes if there is none. */
static uint32_t first_row(const MissionIo *io, uint32_t id)
{
    uint32_t i = 0u;
    while (i < io->n_lanes && io->lanes[i].message != id) {
        i++;
    }
    return i;
}

void mission_io_put(const MissionIo *io, const RegisterWindow *w, uint32_t id, const void *message,
                    MissionIoCounts *counts)
{
    const uint32_t first = first_row(io, id);
    if (first < io->n_lanes) {
        (void)put_message(io, w, first, message, counts);
    }
}

void mission_io_take(const MissionIo *io, const RegisterWindow *w, uint32_t id, void *message, int64_t t,
                     MissionIoCounts *counts)
{
    const uint32_t first = first_row(io, id);
    if (first < io->n_lanes) {
        (void)take_message(io, w, first, message, t, counts);
    }
}

int mission_io_carries(const MissionIo *io, uint32_t id)
{
    return first_row(io, id) < io->n_lanes;
}

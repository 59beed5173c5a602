/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_io.h"

#include "registers/field.h"

#include <string.h>

static const RegisterLane *lane_of(const MissionIo *io, const MissionLane *row)
{
    return &io->boards[row->board]->lanes[row->lane];
}

/* ---- one row of the table */

static void put_row(const MissionIo *io, const RegisterWindow *w, const MissionLane *row, const uint8_t *message,
                    MissionIoCounts *counts)
{
    const RegisterLane *lane = lane_of(io, row);
    w += row->board;
    if (row->type) {
        counts->refused += register_put_message(w, lane, row->type, message) != REGISTER_OK;
        return;
    }
    const RegisterField *field = &lane->fields[row->field];
    const uint8_t *p = message + row->offset;
    for (uint32_t i = 0u; i < lane->count; i++, p += element_size(row->number)) {
        int saturated = 0;
        uint32_t word = 0u;
        const int64_t count = register_field_quantise(field, element_read(row->number, p), &saturated);
        (void)register_take_word(w, lane, i, &word); /* to keep the other fields of the word */
        (void)register_put_word(w, lane, i, register_field_place(field, word, count));
        counts->saturated += saturated != 0;
    }
}

static void take_row(const MissionIo *io, const RegisterWindow *w, const MissionLane *row, uint8_t *message,
                     MissionIoCounts *counts)
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
    for (uint32_t i = 0u; i < lane->count; i++, p += element_size(row->number)) {
        uint32_t word = 0u;
        (void)register_take_word(w, lane, i, &word);
        element_write(row->number, p, register_field_value(field, register_field_count(field, word)));
    }
}

/* Write the head of a message that passes in words. Rows of head fields replace these values afterwards. With t < 0 the
 * message stays as if never written. */
static void write_head(uint8_t *message, int64_t t)
{
    Head head;
    memcpy(&head, message, sizeof head);
    head = head_next(head, t, QUALITY_GOOD);
    memcpy(message, &head, sizeof head);
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
    for (uint32_t i = 0u; i < io->n_lanes; i++) {
        const MissionLane *row = &io->lanes[i];
        if (io->messages[row->message].direction == MISSION_IN) {
            uint8_t *message = (uint8_t *)mission + io->messages[row->message].offset;
            if (!row->type && (i == 0u || row[-1].message != row->message)) {
                write_head(message, t);
            }
            take_row(io, w, row, message, counts);
        }
    }
}

void mission_io_write(const MissionIo *io, const RegisterWindow *w, const void *mission, MissionIoCounts *counts)
{
    for (uint32_t i = 0u; i < io->n_lanes; i++) {
        const MissionLane *row = &io->lanes[i];
        if (io->messages[row->message].direction != MISSION_IN) {
            const MissionMessage *m = &io->messages[row->message];
            put_row(io, w, row, (const uint8_t *)mission + m->offset, counts);
        }
    }
}

/* ---- packets */

uint32_t mission_io_receive(const MissionIo *io, const RegisterWindow *w, MissionPackets queue, void *packet,
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

int mission_io_send(const MissionIo *io, const RegisterWindow *w, MissionPackets queue, const void *packet, uint32_t n,
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

void mission_io_put(const MissionIo *io, const RegisterWindow *w, uint32_t id, const void *message,
                    MissionIoCounts *counts)
{
    for (uint32_t i = 0u; i < io->n_lanes; i++) {
        if (io->lanes[i].message == id) {
            put_row(io, w, &io->lanes[i], message, counts);
        }
    }
}

void mission_io_take(const MissionIo *io, const RegisterWindow *w, uint32_t id, void *message, int64_t t,
                     MissionIoCounts *counts)
{
    int first = 1;
    for (uint32_t i = 0u; i < io->n_lanes; i++) {
        if (io->lanes[i].message == id) {
            if (first && !io->lanes[i].type && t >= 0) {
                write_head(message, t);
            }
            take_row(io, w, &io->lanes[i], message, counts);
            first = 0;
        }
    }
}

int mission_io_carries(const MissionIo *io, uint32_t id)
{
    for (uint32_t i = 0u; i < io->n_lanes; i++) {
        if (io->lanes[i].message == id) {
            return 1;
        }
    }
    return 0;
}

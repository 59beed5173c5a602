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

/* ---- one message: the rows from i on, up to the first of another message, which is returned */

static uint32_t put_message(const MissionIo *io, const RegisterWindow *w, uint32_t i, const uint8_t *message,
                            MissionIoCounts *counts)
{
    const uint16_t id = io->lanes[i].message;
    while (i < io->n_lanes && io->lanes[i].message == id) {
        const uint32_t next = io->packets ? io->packets->functions->put(io, w, i, message, counts) : i;
        if (next == i) {
            put_row(io, w, &io->lanes[i++], message, counts);
        } else {
            i = next;
        }
    }
    return i;
}

static uint32_t take_message(const MissionIo *io, const RegisterWindow *w, uint32_t i, uint8_t *message, int64_t t,
                             MissionIoCounts *counts)
{
    const uint16_t id = io->lanes[i].message;
    int headed = t < 0 || io->lanes[i].type; /* at a reset the message stays as if never written */
    while (i < io->n_lanes && io->lanes[i].message == id) {
        const uint32_t next = io->packets ? io->packets->functions->take(io, w, i, message, t, &headed, counts) : i;
        if (next != i) {
            i = next;
            continue;
        }
        if (!headed) {
            mission_io_head(message, t);
            headed = 1;
        }
        take_row(io, w, &io->lanes[i++], message, counts);
    }
    return i;
}

void mission_io_forget(const MissionIo *io, const RegisterWindow *w)
{
    if (io->packets) {
        io->packets->functions->forget(io, w);
    }
}

uint32_t mission_io_lost(const MissionIo *io, const RegisterWindow *w)
{
    return io->packets ? io->packets->functions->lost(io, w) : 0u;
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

int mission_io_restarted(const MissionIo *io, const RegisterWindow *w, MissionStart *start)
{
    const uint32_t resets = register_clock_resets(&w[mission_io_clock(io)]);
    const int restarted = start->begun == 0u || start->resets != resets;
    *start = (MissionStart){1u, resets};
    if (restarted) {
        mission_io_forget(io, NULL);
    }
    return restarted;
}

/* All lanes are read: their interrupts are handled. */
static void handle_interrupts(const MissionIo *io, const RegisterWindow *w)
{
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        const RegisterBoard *board = io->boards[i];
        (void)register_handle(&w[i], (uint32_t)board->clock_interrupt);
        for (uint32_t k = 0u; k < board->n_lanes; k++) {
            if ((board->lanes[k].flags & REGISTER_FROM_FLIGHT) == 0u) {
                (void)register_handle(&w[i], (uint32_t)board->lanes[k].interrupt); /* -1 is no line */
            }
        }
    }
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
    handle_interrupts(io, w);
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

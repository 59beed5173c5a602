/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_io.h"

#include "registers/field.h"

#include <string.h>

static const RegisterLane *lane_of(const MissionIo *io, const MissionLane *row)
{
    return &io->boards[row->board]->lanes[row->lane];
}

/* ---- numbers in memory */

static uint32_t size_of(MissionNumber number)
{
    static const uint8_t sizes[] = {8u, 4u, 1u, 1u, 2u, 2u, 4u, 4u, 8u, 8u};
    return sizes[number];
}

#define LOAD(ctype)                                                                                                    \
    {                                                                                                                  \
        ctype v;                                                                                                       \
        memcpy(&v, p, sizeof v);                                                                                       \
        return (double)v;                                                                                              \
    }

static double load(MissionNumber number, const uint8_t *p)
{
    switch (number) {
    case MISSION_F64: LOAD(double)
    case MISSION_F32: LOAD(float)
    case MISSION_I8: LOAD(int8_t)
    case MISSION_U8: LOAD(uint8_t)
    case MISSION_I16: LOAD(int16_t)
    case MISSION_U16: LOAD(uint16_t)
    case MISSION_I32: LOAD(int32_t)
    case MISSION_U32: LOAD(uint32_t)
    case MISSION_I64: LOAD(int64_t)
    case MISSION_U64: LOAD(uint64_t)
    }
    return 0.0;
}

/* The whole number nearest to x, from low to high; the ends are below 2^63. */
static int64_t whole(double x, double low, double high)
{
    const double held = x > low ? (x < high ? x : high) : low;
    return (int64_t)(held < 0.0 ? held - 0.5 : held + 0.5);
}

#define STORE(ctype, value)                                                                                            \
    {                                                                                                                  \
        const ctype v = (ctype)(value);                                                                                \
        memcpy(p, &v, sizeof v);                                                                                       \
        return;                                                                                                        \
    }

static void store(MissionNumber number, uint8_t *p, double x)
{
    switch (number) {
    case MISSION_F64: STORE(double, x)
    case MISSION_F32: STORE(float, x)
    case MISSION_I8: STORE(int8_t, whole(x, -128.0, 127.0))
    case MISSION_U8: STORE(uint8_t, whole(x, 0.0, 255.0))
    case MISSION_I16: STORE(int16_t, whole(x, -32768.0, 32767.0))
    case MISSION_U16: STORE(uint16_t, whole(x, 0.0, 65535.0))
    case MISSION_I32: STORE(int32_t, whole(x, -2147483648.0, 2147483647.0))
    case MISSION_U32: STORE(uint32_t, whole(x, 0.0, 4294967295.0))
    case MISSION_I64: STORE(int64_t, whole(x, -9.0e15, 9.0e15))
    case MISSION_U64: STORE(uint64_t, whole(x, 0.0, 9.0e15))
    }
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
    for (uint32_t i = 0u; i < lane->count; i++, p += size_of(row->number)) {
        int saturated = 0;
        uint32_t word = 0u;
        const int64_t count = register_field_quantise(field, load(row->number, p), &saturated);
        (void)register_take_word(w, lane, i, &word); /* the word's other fields stay */
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
            memset(message, 0, row->type->size); /* it was touched, and is no message */
        }
        counts->corrupt += status == REGISTER_CORRUPT || status == REGISTER_SIZE;
        return;
    }
    const RegisterField *field = &lane->fields[row->field];
    uint8_t *p = message + row->offset;
    for (uint32_t i = 0u; i < lane->count; i++, p += size_of(row->number)) {
        uint32_t word = 0u;
        (void)register_take_word(w, lane, i, &word);
        store(row->number, p, register_field_value(field, register_field_count(field, word)));
    }
}

/* A message in words has no head of its own: it was measured now. Fields of its head that are
 * carried are set afterwards, by their own rows. Before time 0 it is as if never written. */
static void write_head(uint8_t *message, int64_t t)
{
    Head head;
    memcpy(&head, message, sizeof head);
    head = head_next(head, t, QUALITY_GOOD);
    memcpy(message, &head, sizeof head);
}

/* A block that is new replaces the one in use, as a whole. */
static void take_parameters(const MissionIo *io, const RegisterWindow *w, const MissionLane *row, uint8_t *mission,
                            MissionIoCounts *counts)
{
    const MissionParameters *block = &io->parameters[row->message - io->n_messages];
    RegisterInfo info;
    const RegisterStatus status = register_take_message(w + row->board, lane_of(io, row), row->type, io->block, &info);
    if (status == REGISTER_OK) {
        memcpy(mission + block->offset, io->block, block->size);
    }
    counts->corrupt += status == REGISTER_CORRUPT || status == REGISTER_SIZE;
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
        if (row->message >= io->n_messages) {
            take_parameters(io, w, row, mission, counts);
        } else if (io->messages[row->message].direction == MISSION_IN) {
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
        if (row->message < io->n_messages && io->messages[row->message].direction != MISSION_IN) {
            const MissionMessage *m = &io->messages[row->message];
            put_row(io, w, row, (const uint8_t *)mission + m->offset, counts);
        }
    }
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

/* SPDX-License-Identifier: Apache-2.0 */
#define _POSIX_C_SOURCE 200809L
#include "targets/linux/inputs.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct Row {
    int64_t t;
    uint32_t kind;
    uint32_t n;
} Row;

static Row row_at(const uint8_t *at)
{
    Row row;
    memcpy(&row, at, sizeof row);
    return row;
}

static size_t size_of(Row row)
{
    return sizeof row + ((size_t)row.n + 7u) / 8u * 8u;
}

static const char *check(const Inputs *inputs, const MissionIo *io)
{
    const uint8_t *at = inputs->at;
    int64_t t = -1;
    int open = 0; /* records wait for their instant */
    while (at != inputs->end) {
        const size_t left = (size_t)(inputs->end - at);
        const Row row = left < sizeof row ? (Row){0, 0u, 0u} : row_at(at);
        if (left < sizeof row || left < size_of(row)) {
            return "the file ends within a record";
        }
        if (open ? row.t != t : row.t <= t) {
            return "the times do not rise";
        }
        if (row.kind < io->n_messages) {
            const MissionMessage *m = &io->messages[row.kind];
            if (m->direction != MISSION_IN || m->size != row.n) {
                return "it is of another mission";
            }
        } else if (row.kind == INPUTS_COMMAND ? io->commands.board == MISSION_NO_BOARD || row.n > io->room
                                              : row.kind < INPUTS_MARK || row.n != 0u) {
            return "it is of another mission";
        }
        t = row.t;
        open = row.kind != INPUTS_INSTANT;
        at += size_of(row);
    }
    return open ? "the last instant is not whole" : NULL;
}

const char *inputs_open(Inputs *inputs, const char *path, const MissionIo *io)
{
    struct stat about;
    uint64_t magic = 0u;
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0 || fstat(file, &about) != 0) {
        return strerror(errno);
    }
    const size_t size = (size_t)about.st_size;
    if (size < sizeof magic) {
        (void)close(file);
        return "it holds no inputs of flight";
    }
    void *map = mmap(NULL, size, PROT_READ, MAP_PRIVATE, file, 0);
    (void)close(file);
    if (map == MAP_FAILED) {
        return strerror(errno);
    }
    memcpy(&magic, map, sizeof magic);
    if (magic != INPUTS_MAGIC) {
        return "it holds no inputs of flight, or those of a machine of another byte order";
    }
    inputs->at = (const uint8_t *)map + sizeof magic;
    inputs->end = (const uint8_t *)map + size;
    return check(inputs, io);
}

int64_t inputs_next(const Inputs *inputs)
{
    return inputs->at != inputs->end ? row_at(inputs->at).t : INT64_MAX;
}

void inputs_put(Inputs *inputs, const MissionIo *io, const RegisterWindow *w, MissionIoCounts *counts)
{
    Row row;
    do {
        const uint8_t *bytes = inputs->at + sizeof row;
        row = row_at(inputs->at);
        inputs->at += size_of(row);
        if (row.kind == INPUTS_MARK) {
            inputs_mark();
        } else if (row.kind == INPUTS_COMMAND) {
            (void)mission_io_send(io, w, io->commands, bytes, row.n, counts);
        } else if (row.kind != INPUTS_INSTANT) {
            mission_io_put(io, w, row.kind, bytes, counts);
        }
    } while (row.kind != INPUTS_INSTANT);
}

void __attribute__((noinline)) inputs_mark(void)
{
    __asm__ volatile("");
}

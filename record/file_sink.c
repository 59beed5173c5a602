/* SPDX-License-Identifier: Apache-2.0 */
#define _POSIX_C_SOURCE 200809L
#include "record/file_sink.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char SUFFIX[] = ".part";

int file_sink_open(FileSink *s, const char *name)
{
    s->fd = -1;
    s->error = 0;
    size_t n = strlen(name);
    if (n == 0u || n > sizeof s->part - sizeof SUFFIX) {
        s->error = n == 0u ? ENOENT : ENAMETOOLONG;
        return s->error;
    }
    memcpy(s->part, name, n);
    memcpy(s->part + n, SUFFIX, sizeof SUFFIX);
    s->fd = open(s->part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (s->fd < 0) {
        s->error = errno;
    }
    return s->error;
}

int file_sink_write(void *sink, const void *bytes, size_t n)
{
    FileSink *s = sink;
    const uint8_t *p = bytes;
    while (n > 0u && s->error == 0) {
        ssize_t done = write(s->fd, p, n);
        if (done > 0) {
            p += done;
            n -= (size_t)done;
        } else if (done == 0) {
            s->error = ENOSPC; /* write() took no byte and reported no error: the disk is full */
        } else if (errno != EINTR) {
            s->error = errno;
        }
    }
    return s->error;
}

int file_sink_close(FileSink *s, bool whole)
{
    if (s->fd < 0) {
        return s->error;
    }
    /* A network file system may report only now that it is full. There is no fsync: after a power failure, the
     * checksums in the archive show missing data. */
    if (close(s->fd) != 0 && s->error == 0) {
        s->error = errno;
    }
    s->fd = -1;
    if (whole && s->error == 0) {
        char name[FILE_SINK_PATH_MAX];
        size_t n = strlen(s->part) - (sizeof SUFFIX - 1u);
        memcpy(name, s->part, n);
        name[n] = '\0';
        if (rename(s->part, name) != 0) {
            s->error = errno;
        }
    }
    return s->error;
}

/* SPDX-License-Identifier: Apache-2.0 */
#define _DEFAULT_SOURCE /* flock */
#include "record/file_sink.h"

#include "record/mcap_crc.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static const char SUFFIX[] = ".part";

enum { ATTEMPTS = 100 }; /* at a .part that other programs take and leave meanwhile */

/* Whether the path still leads to the open file: another program may have renamed or deleted it. */
static bool is_ours(const FileSink *s)
{
    struct stat here, there;
    return fstat(s->fd, &here) == 0 && lstat(s->part, &there) == 0 && here.st_dev == there.st_dev &&
           here.st_ino == there.st_ino;
}

/* Lock the open file, and see that it is a regular file and still has its name. Returns 0, EBUSY if another sink has
 * the lock, ESTALE if the file has lost its name, or another errno. */
static int take(const FileSink *s)
{
    struct stat file;
    if (fstat(s->fd, &file) != 0) {
        return errno;
    }
    if (!S_ISREG(file.st_mode)) {
        return EEXIST;
    }
    /* On a file system without locks, is_ours() finds out at the end, and the file of the last program stays. */
    if (flock(s->fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
        return EBUSY;
    }
    return is_ours(s) ? 0 : ESTALE;
}

static void leave(FileSink *s)
{
    (void)close(s->fd);
    s->fd = -1;
}

/* One attempt to create the .part, or else to delete that of a program that ended. Returns 0 if it is created, ESTALE
 * for another attempt, or errno. */
static int attempt(FileSink *s)
{
    /* A new file, never the old one emptied: other names and readers of that may exist. */
    s->fd = open(s->part, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (s->fd >= 0) {
        const int error = take(s);
        /* A program that found the new file before it was locked deletes it, and creates its own. */
        return error == EBUSY ? ESTALE : error;
    }
    if (errno != EEXIST) {
        return errno;
    }
    s->fd = open(s->part, O_WRONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (s->fd < 0) {
        return errno == ENOENT ? ESTALE : errno;
    }
    const int error = take(s);
    return error == 0 && unlink(s->part) != 0 ? errno : error == 0 ? ESTALE : error;
}

/* Begin with a sink whose file is not open yet. Returns 0 or errno. */
static int name_it(FileSink *s, const char *name)
{
    s->fd = -1;
    s->error = 0;
    memset(&s->marked, 0, sizeof s->marked);
    size_t n = strlen(name);
    if (n == 0u || n > sizeof s->part - sizeof SUFFIX) {
        s->error = n == 0u ? ENOENT : ENAMETOOLONG;
        return s->error;
    }
    memcpy(s->part, name, n);
    memcpy(s->part + n, SUFFIX, sizeof SUFFIX);
    return 0;
}

int file_sink_open(FileSink *s, const char *name)
{
    if (name_it(s, name) != 0) {
        return s->error;
    }
    s->error = ESTALE;
    for (int i = 0; i < ATTEMPTS && s->error == ESTALE; i++) {
        s->error = attempt(s);
        if (s->error != 0 && s->fd >= 0) {
            leave(s);
        }
    }
    return s->error;
}

/* Bring the mark up to a size, by the bytes of the file. Returns 0 or errno: ENODATA if it has fewer. */
static int mark_until(FileSink *s, uint64_t size)
{
    McapCrc tables;
    uint8_t bytes[4096];
    mcap_crc_init(&tables);
    while (s->marked.size < size) {
        const uint64_t left = size - s->marked.size;
        const ssize_t n = pread(s->fd, bytes, left < sizeof bytes ? (size_t)left : sizeof bytes, (off_t)s->marked.size);
        if (n > 0) {
            s->marked.crc = mcap_crc_update(&tables, s->marked.crc, bytes, (size_t)n);
            s->marked.size += (uint64_t)n;
        } else if (n == 0) {
            return ENODATA;
        } else if (errno != EINTR) {
            return errno;
        }
    }
    return 0;
}

int file_sink_resume(FileSink *s, const char *name, FileMark mark)
{
    if (name_it(s, name) != 0) {
        return s->error;
    }
    s->fd = open(s->part, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    s->error = s->fd < 0 ? errno : take(s);
    if (s->error == 0) {
        s->error = mark_until(s, mark.size);
    }
    if (s->error == 0 && s->marked.crc != mark.crc) {
        s->error = ENODATA;
    }
    if (s->error == 0 && (ftruncate(s->fd, (off_t)mark.size) != 0 || lseek(s->fd, 0, SEEK_END) < 0)) {
        s->error = errno;
    }
    if (s->error != 0 && s->fd >= 0) {
        leave(s);
    }
    return s->error;
}

int file_sink_mark(FileSink *s, FileMark *mark)
{
    const off_t size = s->error == 0 ? lseek(s->fd, 0, SEEK_CUR) : 0;
    if (s->error == 0) {
        s->error = size < 0 ? errno : mark_until(s, (uint64_t)size);
    }
    *mark = s->marked;
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

int file_sink_ahead(void *sink, size_t offset, const void *bytes, size_t n)
{
    FileSink *s = sink;
    const off_t here = lseek(s->fd, 0, SEEK_CUR);
    if (s->error == 0 && (here < 0 || lseek(s->fd, (off_t)offset, SEEK_CUR) < 0)) {
        s->error = errno;
    }
    (void)file_sink_write(sink, bytes, n);
    if (s->error == 0 && lseek(s->fd, here, SEEK_SET) < 0) {
        s->error = errno;
    }
    return s->error;
}

int file_sink_close(FileSink *s, bool whole)
{
    if (s->fd < 0) {
        return s->error;
    }
    if (whole && s->error == 0) {
        char name[FILE_SINK_PATH_MAX];
        size_t n = strlen(s->part) - (sizeof SUFFIX - 1u);
        memcpy(name, s->part, n);
        name[n] = '\0';
        /* On the disk before it has its name, so that a power failure leaves no file of that name that is not whole. */
        const int safe = fdatasync(s->fd) == 0 || errno == EINVAL || errno == ENOSYS;
        if (safe && !is_ours(s)) {
            s->error = ESTALE;
        } else if (!safe || rename(s->part, name) != 0) {
            s->error = errno;
        }
    }
    /* The lock ends with the file, so after the rename. */
    if (close(s->fd) != 0 && s->error == 0) {
        s->error = errno;
    }
    s->fd = -1;
    return s->error;
}

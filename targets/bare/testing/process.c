/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: a board that is a process here, on the other end of a terminal or of a socket.
 *
 *     board LINE [KEPT]
 *
 * LINE is the path of a terminal, or the number of an inherited descriptor. SIGUSR1 resets the board: the process
 * starts again in itself, and has its kept memory still, but none of the bytes that were on their way to it. KEPT, a
 * file, keeps it longer than the process lives. The board ends when the line does. */
#define _GNU_SOURCE /* memfd_create */
#include "targets/bare/bare.h"
#include "targets/bare/port.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { KEPT_BYTES = 65536, PATIENCE_MS = 5 };
#define KEPT_AT UINT64_C(0x100000000) /* the same at each start, as port.h asks */

static int line, kept;
static char *again[4];
static char line_text[16], kept_text[16];

static void fail(const char *what) __attribute__((noreturn));

static void fail(const char *what)
{
    (void)fprintf(stderr, "board: %s: %s\n", what, strerror(errno));
    _exit(2);
}

static void reset(int number)
{
    (void)number;
    (void)tcflush(line, TCIFLUSH);
    (void)execv("/proc/self/exe", again);
    _exit(2);
}

void board_send(const void *bytes, size_t n)
{
    const char *p = bytes;
    while (n > 0u) {
        const ssize_t sent = write(line, p, n);
        if (sent > 0) {
            p += sent;
            n -= (size_t)sent;
        } else if (errno != EINTR && errno != EAGAIN) {
            _exit(3); /* the line is gone */
        } else {
            struct pollfd ready = {line, POLLOUT, 0};
            (void)poll(&ready, 1u, PATIENCE_MS);
        }
    }
}

size_t board_receive(void *bytes, size_t room)
{
    struct pollfd ready = {line, POLLIN, 0};
    if (poll(&ready, 1u, PATIENCE_MS) <= 0) {
        return 0u;
    }
    const ssize_t n = read(line, bytes, room);
    if (n == 0 || (n < 0 && errno != EINTR && errno != EAGAIN)) {
        _exit(3);
    }
    return n > 0 ? (size_t)n : 0u;
}

int64_t board_time(void)
{
    struct timespec t = {0, 0};
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

void board_watch(void) {}

void *board_keep(size_t size)
{
    const int shared = MAP_SHARED | MAP_FIXED_NOREPLACE;
    void *memory = mmap((void *)KEPT_AT, KEPT_BYTES, PROT_READ | PROT_WRITE, shared, kept, 0);
    if (size > KEPT_BYTES) {
        return NULL;
    }
    if (memory == MAP_FAILED) {
        fail("kept memory");
    }
    return memory;
}

/* A descriptor by its number, or an opened path. */
static int open_descriptor(const char *text, int flags)
{
    char *end;
    const long number = strtol(text, &end, 10);
    return *end == '\0' ? (int)number : open(text, O_RDWR | O_NOCTTY | flags, 0600);
}

int main(int argc, char **argv)
{
    struct termios raw;
    sigset_t none;
    if (argc != 2 && argc != 3) {
        (void)fprintf(stderr, "usage: %s LINE [KEPT]\n", argv[0]);
        return 2;
    }
    line = open_descriptor(argv[1], 0);
    kept = argc == 3 ? open_descriptor(argv[2], O_CREAT) : memfd_create("kept", 0u);
    if (line < 0 || kept < 0 || ftruncate(kept, KEPT_BYTES) != 0) {
        fail(argv[1]);
    }
    if (tcgetattr(line, &raw) == 0) {
        cfmakeraw(&raw);
        (void)tcsetattr(line, TCSANOW, &raw);
    }
    (void)snprintf(line_text, sizeof line_text, "%d", line);
    (void)snprintf(kept_text, sizeof kept_text, "%d", kept);
    again[0] = argv[0];
    again[1] = line_text;
    again[2] = kept_text;
    (void)sigemptyset(&none);
    (void)signal(SIGUSR1, reset);
    (void)sigprocmask(SIG_SETMASK, &none, NULL); /* the one before the reset was in the signal's handler */
    return fledge_fly();
}

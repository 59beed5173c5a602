/* SPDX-License-Identifier: Apache-2.0 */
#define _POSIX_C_SOURCE 200809L
#include "targets/linux/line_io.h"

#include <errno.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

enum { PATIENCE_MS = 5, LINE_GONE = 3 };

int line_in = STDIN_FILENO, line_out = STDOUT_FILENO;

void board_send(const void *bytes, size_t n)
{
    const char *p = bytes;
    while (n > 0u) {
        const ssize_t sent = write(line_out, p, n);
        if (sent > 0) {
            p += sent;
            n -= (size_t)sent;
        } else if (errno != EINTR && errno != EAGAIN) {
            _exit(LINE_GONE);
        } else {
            struct pollfd ready = {line_out, POLLOUT, 0};
            (void)poll(&ready, 1u, PATIENCE_MS);
        }
    }
}

size_t board_receive(void *bytes, size_t room)
{
    struct pollfd ready = {line_in, POLLIN, 0};
    if (poll(&ready, 1u, PATIENCE_MS) <= 0) {
        return 0u;
    }
    const ssize_t n = read(line_in, bytes, room);
    if (n == 0 || (n < 0 && errno != EINTR && errno != EAGAIN)) {
        _exit(LINE_GONE);
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

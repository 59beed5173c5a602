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
#include "targets/linux/line_io.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <termios.h>
#include <unistd.h>

enum { KEPT_BYTES = 65536 };
#define KEPT_AT UINT64_C(0x100000000) /* the same at each start, as port.h asks */

static int kept;
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
    (void)tcflush(line_in, TCIFLUSH);
    (void)execv("/proc/self/exe", again);
    _exit(2);
}

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
    line_in = line_out = open_descriptor(argv[1], 0);
    kept = argc == 3 ? open_descriptor(argv[2], O_CREAT) : memfd_create("kept", 0u);
    if (line_in < 0 || kept < 0 || ftruncate(kept, KEPT_BYTES) != 0) {
        fail(argv[1]);
    }
    if (tcgetattr(line_in, &raw) == 0) {
        cfmakeraw(&raw);
        (void)tcsetattr(line_in, TCSANOW, &raw);
    }
    (void)snprintf(line_text, sizeof line_text, "%d", line_in);
    (void)snprintf(kept_text, sizeof kept_text, "%d", kept);
    again[0] = argv[0];
    again[1] = line_text;
    again[2] = kept_text;
    (void)sigemptyset(&none);
    (void)signal(SIGUSR1, reset);
    (void)sigprocmask(SIG_SETMASK, &none, NULL); /* the one before the reset was in the signal's handler */
    return fledge_fly();
}

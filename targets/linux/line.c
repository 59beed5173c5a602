/* SPDX-License-Identifier: Apache-2.0 */
/* A process of Linux as a board at a line: the five functions of targets/bare/port.h.
 *
 *     PROGRAM                 the line is its input and output, as ssh gives them
 *     PROGRAM DEVICE [BAUD]   a serial port of this computer; default: 921600
 *
 * It flies one run, and ends with it, or with the line. */
#define _DEFAULT_SOURCE
#include "targets/bare/bare.h"
#include "targets/linux/line_io.h"

#include <asm/termbits.h> /* any rate, which <termios.h> does not have */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

enum { KEPT_WORDS = 8192 };

static uint64_t kept[KEPT_WORDS];

/* Each start of the process is a power-on. */
void *board_keep(size_t size)
{
    return size <= sizeof kept ? kept : NULL;
}

/* 8 bits without parity, as they are. Returns the descriptor, or -1. */
static int open_serial(const char *device, unsigned long baud)
{
    struct termios2 raw;
    const int fd = open(device, O_RDWR | O_NOCTTY);
    if (fd < 0 || ioctl(fd, TCGETS2, &raw) != 0) {
        return -1;
    }
    raw.c_iflag = 0;
    raw.c_oflag = 0;
    raw.c_lflag = 0;
    raw.c_cflag = CS8 | CREAD | CLOCAL | BOTHER;
    raw.c_ispeed = (unsigned)baud;
    raw.c_ospeed = (unsigned)baud;
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    return ioctl(fd, TCSETS2, &raw) == 0 ? fd : -1;
}

int main(int argc, char **argv)
{
    char *end = "";
    const unsigned long baud = argc == 3 ? strtoul(argv[2], &end, 10) : 921600u;
    if (argc > 3 || *end != '\0' || baud < 300u || baud > 20000000u) {
        (void)fprintf(stderr, "usage: %s [DEVICE [BAUD]]\n", argv[0]);
        return 2;
    }
    if (argc > 1) {
        line_in = line_out = open_serial(argv[1], baud);
        if (line_in < 0) {
            (void)fprintf(stderr, "%s: %s: %s\n", argv[0], argv[1], strerror(errno));
            return 2;
        }
    }
    return fledge_fly();
}

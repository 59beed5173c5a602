/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: the line of a board as the console of picolibc, and of faults. */
#include "targets/bare/fault.h"
#include "targets/bare/port.h"

#include <stdio.h>

static int put(char c, FILE *file)
{
    (void)file;
    board_send(&c, 1u);
    return 0;
}

static FILE line = FDEV_SETUP_STREAM(put, NULL, NULL, _FDEV_SETUP_WRITE);
FILE *const stdout = &line;
FILE *const stderr = &line;

void bare_shout(const char *text, size_t n)
{
    board_send(text, n);
}

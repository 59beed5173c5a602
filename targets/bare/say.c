/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/bare/bare.h"

static void say_in(uint32_t value, uint32_t base, int digits)
{
    char text[11];
    char *p = text + sizeof text;
    *--p = '\0';
    do {
        *--p = "0123456789abcdef"[value % base];
        value /= base;
    } while (value != 0u || p > text + sizeof text - 1 - digits);
    bare_say(p);
}

void bare_say_number(uint32_t value)
{
    say_in(value, 10u, 1);
}

void bare_say_hex(uint32_t value)
{
    say_in(value, 16u, 8);
}

void bare_say_figure(const char *key, uint32_t value)
{
    bare_say(key);
    bare_say(" ");
    bare_say_number(value);
    bare_say("\n");
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/bare/fault.h"

static char text[BARE_FAULT_TEXT];
static size_t used;

static void put(const char *words)
{
    while (*words != '\0' && used < sizeof text) {
        text[used++] = *words++;
    }
}

static void put_hex(uintptr_t value, size_t least)
{
    char digits[2u * sizeof value + 1u];
    char *p = digits + sizeof digits;
    *--p = '\0';
    do {
        *--p = "0123456789abcdef"[value % 16u];
        value /= 16u;
    } while (value != 0u || p > digits + sizeof digits - 1u - least);
    put(p);
}

void bare_fault(const BareFault *fault)
{
    used = 0u;
    put("fault: ");
    put(fault->problem);
    put(" at 0x");
    put_hex(fault->pc, 8u);
    if (fault->caller != 0u) {
        put(", called from 0x");
        put_hex(fault->caller, 8u);
    }
    for (size_t i = 0u; i < fault->n; i++) {
        const size_t before = used;
        put(i == 0u ? "\n" : " ");
        put(fault->names[i]);
        put(" ");
        put_hex(fault->registers[i], 1u);
        if (used >= sizeof text - 1u) { /* no half numbers */
            used = before;
            break;
        }
    }
    put("\n");
    bare_shout(text, used);
}

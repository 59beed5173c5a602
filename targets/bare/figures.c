/* SPDX-License-Identifier: Apache-2.0 */
/* The memory that a flight has used, on a board whose linker script has the symbols of memory.h. */
#include "targets/bare/bare.h"
#include "targets/bare/memory.h"

static uint32_t between(const uint8_t *begin, const uint8_t *end)
{
    return (uint32_t)((uintptr_t)end - (uintptr_t)begin);
}

void bare_say_figures(void)
{
    const uint8_t *p = board_stack;
    while (p < board_stack_end && *(const uint32_t *)(const void *)p == BARE_PAINT) {
        p += 4;
    }
    const uint32_t stack = between(p, board_stack_end);
    bare_say_figure("program_bytes", between(board_code, board_data_load) + between(board_data, board_data_end));
    bare_say_figure("data_bytes", between(board_data, board_bss_end));
    bare_say_figure("ram_bytes", between(board_ram, board_bss_end) + (uint32_t)bare_kept + stack);
    bare_say_figure("stack_bytes", stack);
}

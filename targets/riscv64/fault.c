/* SPDX-License-Identifier: Apache-2.0 */
/* The report of an exception, or of a watchdog that has expired, from the words of start.S. */
#include "targets/bare/fault.h"
#include "targets/bare/memory.h"
#include "targets/riscv64/riscv64.h"

uint64_t board_registers[32];
uint64_t board_fault_stack[BOARD_FAULT_STACK / 8] __attribute__((aligned(16)));

static const char *problem_of(uint64_t cause, uint64_t value)
{
    static const char *const known[] = {"jump to an odd address",
                                        "jump to what is no code",
                                        "unknown instruction",
                                        "breakpoint",
                                        "load from an address that is not aligned",
                                        "load from protected memory, or where none is,",
                                        "store to an address that is not aligned",
                                        "store to protected memory, or where none is,"};
    if ((cause == 5u || cause == 7u) && value - (uintptr_t)board_guard < (uintptr_t)(board_stack - board_guard)) {
        return "stack overflow";
    }
    return cause < sizeof known / sizeof known[0] ? known[cause] : "exception without a handler";
}

void board_exception(uint64_t cause, uint64_t pc, uint64_t value)
{
    static const struct {
        const char *name;
        int n;
    } order[] = {{"sp", 2},  {"ra", 1},  {"a0", 10},  {"a1", 11},  {"a2", 12}, {"a3", 13}, {"a4", 14},
                 {"a5", 15}, {"s0", 8},  {"s1", 9},   {"a6", 16},  {"a7", 17}, {"t0", 5},  {"t1", 6},
                 {"t2", 7},  {"s2", 18}, {"s3", 19},  {"s4", 20},  {"s5", 21}, {"s6", 22}, {"s7", 23},
                 {"s8", 24}, {"s9", 25}, {"s10", 26}, {"s11", 27}, {"gp", 3}};
    enum { N = sizeof order / sizeof order[0] };
    static const char *names[N + 2];
    static uintptr_t values[N + 2];
    static int reported;
    if (reported == 0) { /* else the report itself has failed */
        reported = 1;
        names[0] = "cause";
        values[0] = cause;
        names[1] = "address";
        values[1] = value;
        for (int i = 0; i < N; i++) {
            names[i + 2] = order[i].name;
            values[i + 2] = board_registers[order[i].n];
        }
        const BareFault fault = {board_late != 0u ? "watchdog: the program was not idle for 10 s,"
                                                  : problem_of(cause, value),
                                 board_late != 0u ? board_late : pc,
                                 board_registers[1],
                                 names,
                                 values,
                                 N + 2};
        bare_fault(&fault);
    }
    board_reset();
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Registers and record of flight on a LEON3 board, with or without an operating system. */
#include "registers/plug_and_play.h"
#include "targets/bare/recorder.h"
#include "targets/leon3/leon3.h"

/* Neither the loader nor the start of the program change this section. */
static RecorderKept kept __attribute__((aligned(8), section(".noinit")));

void *bare_keep(size_t size)
{
    return size <= sizeof kept ? &kept : NULL;
}

static void count_interrupt(void)
{
    leon3.board_interrupts++;
}

/* The interrupts of boards wake the processor, which reads the lanes at the next tick. */
void bare_begin(const MissionHost *mission, RegisterWindow *windows)
{
    const MissionIo *io = mission->io;
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        const uint64_t at = leon3.registers + register_bus_offset(io->boards, io->n_boards, io->boards[i]);
        const uint32_t level = io->boards[i]->level;
        windows[i] = register_window(io->boards[i], (volatile uint32_t *)(uintptr_t)at);
        if (level != 0u && level != leon3.registers_line && level != leon3.timer_line) {
            leon3_on_interrupt(level, count_interrupt);
        }
    }
}

void bare_recording(BareRecording state)
{
    leon3_console_off = state != BARE_RECORD_ENDED && leon3.link == leon3.console;
}

int bare_records(void)
{
    return 1;
}

void bare_record(const void *bytes, size_t n)
{
    leon3_send(leon3.link, bytes, n);
}

void bare_record_flush(void) {}

void bare_say_figures(void)
{
    bare_say_figure("board_interrupts", leon3.board_interrupts);
    bare_say_figure("program_bytes", leon3_program_size());
    bare_say_figure("data_bytes", leon3_data_size());
    bare_say_figure("ram_bytes", leon3_ram_used());
    bare_say_figure("stack_bytes", leon3_stack_used());
}

void bare_end(int status)
{
    (void)status;
}

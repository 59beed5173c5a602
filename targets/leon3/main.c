/* SPDX-License-Identifier: Apache-2.0 */
/* An exported mission as the program of a LEON3 board. The clock of the register space paces flight: at each tick the
 * processor wakes up, flies, answers, and then sends the outputs of flight as a record through the last UART. At the
 * end of the run it prints its counters on the console, a key and a value on each line. */
#include "registers/plug_and_play.h"
#include "targets/leon3/leon3.h"
#include "targets/mission_host.h"

enum { BOARDS_MAX = 4 };

static RegisterWindow windows[BOARDS_MAX];
static MissionIoCounts counts;
static MissionRecord record;

static int send_record(void *user, const void *bytes, size_t n)
{
    (void)user;
    leon3_send(leon3.link, bytes, n);
    return 0;
}

static const RegisterWindow *place_windows(void)
{
    const MissionIo *io = fledge_mission.io;
    uint32_t at = leon3.registers;
    for (uint32_t i = 0u; i < io->n_boards && i < BOARDS_MAX; i++) {
        windows[i] = register_window(io->boards[i], (volatile uint32_t *)(uintptr_t)at);
        at += (io->boards[i]->size + REGISTER_BUS_ALIGNMENT - 1u) / REGISTER_BUS_ALIGNMENT * REGISTER_BUS_ALIGNMENT;
    }
    return &windows[mission_io_clock(io)];
}

int main(void)
{
    uint32_t ticks = 0u;
    Tick tick;
    if (fledge_mission.io->n_boards > BOARDS_MAX) {
        leon3_say("the mission has more than 4 register boards\n");
        return 1;
    }
    fledge_mission.init();
    const RegisterWindow *clock = place_windows();
    leon3_console_off = leon3.link == leon3.console;
    McapStatus status = mission_record_open(&record, &fledge_mission, send_record, NULL, "leon3");
    while (status == MCAP_OK) {
        if (register_clock_due(clock, &tick)) {
            mission_host_exchange(&fledge_mission, windows, tick.t, &counts);
            register_clock_finish(clock);
            if (tick.t >= 0) {
                ticks++;
                status = mission_record_take(&record, &fledge_mission, tick.t);
            }
        } else if (register_clock_stopped(clock)) {
            status = mission_record_close(&record);
            break;
        } else {
            leon3_idle();
        }
    }
    leon3_console_off = 0;
    leon3_say_figure("flown", ticks);
    leon3_say_figure("refused", counts.refused);
    leon3_say_figure("corrupt", counts.corrupt);
    leon3_say_figure("saturated", counts.saturated);
    leon3_say_figure("skipped", counts.skipped);
    leon3_say_figure("data_bytes", leon3_data_size());
    leon3_say_figure("stack_bytes", leon3_stack_used());
    if (status != MCAP_OK) {
        leon3_say("the record failed: ");
        leon3_say(mcap_status_text(status));
        leon3_say("\n");
    }
    return status == MCAP_OK ? 0 : 1;
}

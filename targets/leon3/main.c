/* SPDX-License-Identifier: Apache-2.0 */
/* An exported mission as the program of a LEON3 board. The clock of the register space paces flight: at each tick the
 * processor wakes up, flies, answers, and then records the outputs of flight. */
#include "targets/leon3/leon3.h"
#include "targets/leon3/recorder.h"
#include "targets/leon3/windows.h"

#ifndef TARGET
#define TARGET "leon3"
#endif

static RegisterWindow windows[MISSION_BOARDS_MAX];
static MissionIoCounts counts;

static void say_line(const char *text)
{
    leon3_say(text);
    leon3_say("\n");
}

/* As targets/linux says it: tick:used:peak, and a space. */
static void say_mark(uint32_t tick, MissionHeap heap)
{
    leon3_say_number(tick);
    leon3_say(":");
    leon3_say_number((uint32_t)heap.used);
    leon3_say(":");
    leon3_say_number((uint32_t)heap.peak);
    leon3_say(" ");
}

int main(void)
{
    Tick tick;
    if (fledge_mission.io->n_boards > MISSION_BOARDS_MAX) {
        leon3_say("the mission has more than 4 register boards\n");
        return 1;
    }
    if (fledge_mission.clock != NULL) {
        *fledge_mission.clock = leon3_now;
    }
    fledge_mission.init();
    if (fledge_mission.failure != NULL && fledge_mission.failure() != NULL) {
        say_line(fledge_mission.failure());
        return 1;
    }
    const MissionHeap begun = fledge_mission.heap != NULL ? fledge_mission.heap() : (MissionHeap){0u, 0u};
    leon3_place_windows(fledge_mission.io, windows);
    leon3_hear_boards(fledge_mission.io);
    const RegisterWindow *clock = &windows[mission_io_clock(fledge_mission.io)];
    uint32_t ticks = 0u;
    leon3_watch();
    recorder_resume();
    while (!register_clock_stopped(clock)) {
        if (register_clock_due(clock, &tick)) {
            mission_host_exchange(&fledge_mission, windows, tick.t, &counts);
            register_clock_finish(clock);
            ticks++;
            if (tick.t < 0) {
                ticks = 0u;
                recorder_begin(&fledge_mission, TARGET);
            } else {
                recorder_take(&fledge_mission, tick.t, TARGET);
            }
        } else {
            leon3_idle();
        }
    }
    const int status = recorder_end(&counts);
    if (fledge_mission.heap != NULL) {
        const MissionHeap heap = fledge_mission.heap();
        leon3_say("heap ");
        say_mark(0u, begun);
        say_mark(ticks, heap);
        leon3_say("\n");
    }
    if (fledge_mission.figures != NULL) {
        fledge_mission.figures(say_line);
    }
    return status;
}

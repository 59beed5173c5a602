/* SPDX-License-Identifier: Apache-2.0 */
/* An exported mission as the program of a board. The clock of the registers paces flight: at each tick the processor
 * wakes up, flies, answers, and then records the outputs of flight. */
#include "targets/bare/bare.h"
#include "targets/bare/recorder.h"

#include <string.h>

static RegisterWindow windows[MISSION_BOARDS_MAX];
static MissionIoCounts counts;

static void say_line(const char *text)
{
    bare_say(text);
    bare_say("\n");
}

/* As targets/linux prints it: tick:used:peak, and a space. */
static void say_mark(uint32_t tick, MissionHeap heap)
{
    bare_say_number(tick);
    bare_say(":");
    bare_say_number((uint32_t)heap.used);
    bare_say(":");
    bare_say_number((uint32_t)heap.peak);
    bare_say(" ");
}

static int end(int status)
{
    bare_end(status);
    return status;
}

static int fail(const char *text)
{
    bare_recording(BARE_RECORD_ENDED);
    say_line(text);
    return end(1);
}

int fledge_fly(void)
{
    Tick tick;
    memset(&counts, 0, sizeof counts);
    recorder_resume();
    if (fledge_mission.io->n_boards > MISSION_BOARDS_MAX) {
        bare_recording(BARE_RECORD_ENDED);
        say_line("the mission has more than 4 register boards");
        return 1;
    }
    bare_begin(&fledge_mission, windows);
    if (fledge_mission.clock != NULL) {
        *fledge_mission.clock = bare_now;
    }
    fledge_mission.init();
    if (fledge_mission.failure != NULL && fledge_mission.failure() != NULL) {
        return fail(fledge_mission.failure());
    }
    const MissionHeap begun = fledge_mission.heap != NULL ? fledge_mission.heap() : (MissionHeap){0u, 0u};
    const RegisterWindow *clock = &windows[mission_io_clock(fledge_mission.io)];
    uint32_t ticks = 0u;
    bare_watch();
    while (!register_clock_stopped(clock)) {
        if (register_clock_due(clock, &tick)) {
            mission_host_exchange(&fledge_mission, windows, tick.t, &counts);
            recorder_answer(tick.t);
            register_clock_finish(clock);
            ticks++;
            if (tick.t < 0) {
                ticks = 0u;
                recorder_begin(&fledge_mission, TARGET);
            } else {
                recorder_take(&fledge_mission, tick.t, TARGET);
            }
        } else {
            bare_idle();
        }
    }
    const int status = recorder_end(&counts);
    if (fledge_mission.heap != NULL) {
        const MissionHeap heap = fledge_mission.heap();
        bare_say("heap ");
        say_mark(0u, begun);
        say_mark(ticks, heap);
        bare_say("\n");
    }
    if (fledge_mission.figures != NULL) {
        fledge_mission.figures(say_line);
    }
    return end(status);
}

/* Of a program that has no other. */
int main(void) __attribute__((weak));

int main(void)
{
    return fledge_fly();
}

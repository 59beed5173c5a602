/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: an app on a board without an operating system. Its registers are memory at the board's
 * base; the outside comes from the standard input, for each tick a time and all that flight reads,
 * and for each tick all that flight puts out goes to the standard output. */
#define _DEFAULT_SOURCE
#include "registers/clock.h"
#include "targets/cfs/pocket.h"
#include "targets/mission_io.h"

#include <stdio.h>
#include <sys/mman.h>

#define LONGEST 4096

extern const MissionIo fledge_io; /* by -D, the mission's */
extern const PocketApp fledge_apps[];

int bare_idle(void);

static RegisterWindow window;
static MissionIoCounts counts;
static int64_t t = -1; /* of the tick that is flown */
static int started, stopped;
static uint8_t message[LONGEST];

static int read_tick(void)
{
    if (fread(&t, sizeof t, 1, stdin) != 1) {
        return 0;
    }
    for (uint32_t id = 0; id < fledge_io.n_messages; id++) {
        const MissionMessage *m = &fledge_io.messages[id];
        if (m->direction == MISSION_IN) {
            if (fread(message, m->size, 1, stdin) != 1) {
                return 0;
            }
            mission_io_put(&fledge_io, &window, id, message, &counts);
        }
    }
    return 1;
}

static void write_outputs(void)
{
    for (uint32_t id = 0; id < fledge_io.n_messages; id++) {
        const MissionMessage *m = &fledge_io.messages[id];
        if (m->direction != MISSION_IN) {
            mission_io_take(&fledge_io, &window, id, message, t, &counts);
            (void)fwrite(message, m->size, 1, stdout);
        }
    }
}

int bare_idle(void)
{
    if (window.words == NULL || stopped || !register_clock_is_done(&window)) {
        return 0;
    }
    if (started && t >= 0) {
        write_outputs();
    }
    if (started && !read_tick()) {
        register_clock_stop(&window);
        stopped = 1;
    } else {
        const Tick tick = {t, 0};
        started = 1;
        register_clock_start(&window, tick);
    }
    return 0; /* the child sees it when it looks: time goes on */
}

int main(void)
{
    const RegisterBoard *board = fledge_io.boards[0];
    void *at = (void *)(uintptr_t)board->base;
    if (mmap(at, board->size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) != at) {
        return 2;
    }
    window = register_window(board, at);
    pocket_boot("", fledge_apps, 1);
    if (pocket_start_app("fsw", fledge_apps[0].entry_name, "FSW", 55, 16384) != CFE_SUCCESS ||
        !pocket_operational(1000)) {
        return 2;
    }
    while (pocket_running() > 0u) {
        OS_TaskDelay(100);
    }
    return pocket_counts().apps_failed == 0u ? 0 : 1;
}

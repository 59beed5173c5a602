/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: an app on a board without an operating system, with the tasks of targets/bare. Its registers are memory at
 * the board's base; the outside comes from the standard input, for each tick a time and all that flight reads, and for
 * each tick all that flight puts out goes to the standard output. */
#define _DEFAULT_SOURCE
#include "targets/bare/bare.h"
#include "registers/clock.h"
#include "targets/cfs/pocket.h"
#include "targets/cfs/testing/contexts.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>

#define LONGEST 4096
#define PATIENCE INT64_C(60000000000) /* [ns] without a tick */

extern const MissionIo fledge_io; /* by -D, the mission's */
extern const PocketApp fledge_apps[];

static RegisterWindow window;
static MissionIoCounts counts;
static int64_t t = -1; /* of the tick that is flown */
static int started, stopped;
static uint8_t message[LONGEST];
static int64_t last; /* [ns] of the last tick */

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

static void outside(void)
{
    if (window.words == NULL || stopped || !register_clock_is_done(&window)) {
        if (bare_now() - last > PATIENCE) {
            (void)fprintf(stderr, "all tasks wait, for nothing\n");
            exit(3);
        }
        return;
    }
    last = bare_now();
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
}

int main(void)
{
    const RegisterBoard *board = fledge_io.boards[0];
    void *at = (void *)(uintptr_t)board->base;
    if (mmap(at, board->size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) != at) {
        return 2;
    }
    window = register_window(board, at);
    contexts_outside = outside;
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

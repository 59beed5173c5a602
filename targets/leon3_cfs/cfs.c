/* SPDX-License-Identifier: Apache-2.0 */
/* An app of the core Flight System as the program of a LEON3 board, with the pocket cFE. The app is `fsw`, which
 * `fledge export cfs` wrote; this file has its registers, and sends its outputs as a record through the last UART. The
 * compiler includes the header of the app's names in front. */
#include "targets/leon3_cfs/cfs.h"
#include "targets/bare/recorder.h"
#include "targets/bare/tasks.h"
#include "targets/cfs/pocket.h"
#include "targets/cfs/watch.h"
#include "targets/leon3/leon3.h"

extern const PocketApp fledge_apps[];
extern const uint32 fledge_apps_n;

static MissionHost host; /* whose memory is the app's */

/* ---- the registers of the app */

bool FSW_Attach(RegisterWindow *windows, const uint32 *stop);
bool FSW_WaitForRegisters(int32 milliseconds);
void FSW_Detach(bool keep);

bool FSW_Attach(RegisterWindow *windows, const uint32 *stop)
{
    (void)stop;
    bare_begin(&fledge_mission, windows);
    return true;
}

bool FSW_WaitForRegisters(int32 milliseconds)
{
    (void)milliseconds;
    port_wait_for_tick();
    return true;
}

void FSW_Detach(bool keep)
{
    (void)keep;
}

/* ---- the record, and the end */

void fledge_watch(const void *mission, CommandState *commands, MissionStart *start, int64_t t,
                  const MissionIoCounts *counts)
{
    host.mission = (void *)(uintptr_t)mission;
    host.state = commands;
    host.start = start;
    if (t >= 0) {
        recorder_take(&host, t, "leon3-cfs");
    } else if (t == -1) {
        const int result = recorder_end(counts);
        bare_say_figure("task_stack_bytes", port_stack_used());
        bare_say_figure("events_errors", pocket_counts().errors);
        leon3_stop(result);
    }
}

int main(void)
{
    host = fledge_mission;
    bare_watch();
    recorder_resume();
    pocket_boot("", fledge_apps, fledge_apps_n);
    pocket_quiet(true);
    for (uint32 i = 0; i < leon3_files_n; i++) {
        port_add_file(leon3_files[i].path, leon3_files[i].bytes, leon3_files[i].size);
    }
    if (pocket_run_script("/cf/cfe_es_startup.scr") < 0 || !pocket_operational(10000)) {
        bare_say("the app did not start\n");
        return 1;
    }
    while (pocket_running() > 0u) {
        OS_TaskDelay(1000);
    }
    bare_say("the app has ended before the run\n");
    return 1;
}

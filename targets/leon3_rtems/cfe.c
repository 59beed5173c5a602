/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of the app `fsw` under NASA's core Flight Executive, with OSAL's port to RTEMS, and its record. */
#include "targets/bare/recorder.h"
#include "targets/cfs/watch.h"
#include "targets/leon3_rtems/board.h"

#include <fsw_app.h>

static MissionHost host; /* whose memory is the app's */

bool FSW_Attach(RegisterWindow *windows, const uint32 *stop)
{
    (void)stop;
    leon3_begin_flight();
    bare_watch();
    recorder_resume();
    bare_begin(&fledge_mission, windows);
    return true;
}

bool FSW_WaitForRegisters(int32 milliseconds)
{
    (void)milliseconds;
    bare_idle();
    return true;
}

void FSW_Detach(bool keep)
{
    (void)keep;
}

void fledge_watch(const void *mission, CommandState *commands, MissionStart *start, int64_t t,
                  const MissionIoCounts *counts)
{
    host = fledge_mission;
    host.mission = (void *)(uintptr_t)mission;
    host.state = commands;
    host.start = start;
    if (t >= 0) {
        recorder_take(&host, t, "leon3-rtems");
    } else if (t == -1) {
        leon3_stop(recorder_end(counts));
    }
}

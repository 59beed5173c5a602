/* SPDX-License-Identifier: Apache-2.0 */
#define _POSIX_C_SOURCE 200809L
#include "targets/cfs/watch.h"

#include "record/file_sink.h"
#include "targets/mission_host.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static struct {
    MissionHost host; /* whose memory is the app's */
    MissionRecord record;
    FileSink sink;
    uint32_t ticks;
    int open;
    int failed;
    int64_t before; /* [ns] of processor time before the first tick */
} watch;

/* [ns] of the whole process, core included. */
static int64_t processor_time(void)
{
    struct timespec t = {0, 0};
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (int64_t)t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

static void begin(const void *mission, CommandState *commands, MissionStart *start)
{
    const char *path = getenv("FLEDGE_RECORD");
    char name[256];
    /* The record of an app that was here before it was started again stays. */
    for (int i = 2; path != NULL && access(path, F_OK) == 0; i++) {
        (void)snprintf(name, sizeof name, "%s.%d", getenv("FLEDGE_RECORD"), i);
        path = name;
    }
    watch.host = fledge_mission;
    watch.host.mission = (void *)(uintptr_t)mission;
    watch.host.state = commands;
    watch.host.start = start;
    watch.before = processor_time();
    watch.failed = path == NULL || file_sink_open(&watch.sink, path) != 0;
    watch.open = !watch.failed;
    if (watch.open) {
        watch.failed = mission_record_open(&watch.record, &watch.host, file_sink_write, &watch.sink, "cfs") != MCAP_OK;
    }
}

static void leave(void)
{
    if (watch.open) {
        const int whole = mission_record_close(&watch.record) == MCAP_OK && !watch.failed;
        watch.failed = file_sink_close(&watch.sink, whole) != 0 || !whole;
        watch.open = 0;
    }
}

static void finish(const MissionIoCounts *counts)
{
    const double spent = (double)(processor_time() - watch.before);
    leave();
    if (watch.failed) {
        (void)printf("the record could not be written\n");
    } else {
        (void)printf("ticks %" PRIu32 "\ncpu_ns %.0f\nrefused %" PRIu32 "\ncorrupt %" PRIu32 "\nsaturated %" PRIu32
                     "\nskipped %" PRIu32 "\n",
                     watch.ticks, spent / (watch.ticks > 0u ? watch.ticks : 1u), counts->refused, counts->corrupt,
                     counts->saturated, counts->skipped);
    }
    (void)fflush(stdout);
    if (getenv("FLEDGE_END") != NULL) {
        _exit(watch.failed ? 1 : 0);
    }
}

void fledge_watch(const void *mission, CommandState *commands, MissionStart *start, int64_t t,
                  const MissionIoCounts *counts)
{
    if (t < 0) {
        t < -1 ? leave() : finish(counts);
        return;
    }
    if (watch.ticks == 0u) {
        begin(mission, commands, start);
    }
    watch.ticks++;
    if (!watch.failed && mission_record_take(&watch.record, &watch.host, t) != MCAP_OK) {
        watch.failed = 1;
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/leon3/recorder.h"

#include "targets/leon3/leon3.h"

#include <string.h>

enum { SCHEMAS = 64, CHANNELS = 192, BEGUN = 0x4d434150 };

/* Neither the loader nor the start of the program change this section. */
static struct {
    uint32_t begun; ///< BEGUN: the rest is of the program before a reset
    uint32_t busy;  ///< 1: some bytes of a record are sent
    uint32_t taken;
    McapStatus status;
    MissionRecord record;
    McapSchema schemas[SCHEMAS];
    McapChannel channels[CHANNELS];
} kept __attribute__((section(".noinit")));

static int send_record(void *user, const void *bytes, size_t n)
{
    (void)user;
    leon3_send(leon3.link, bytes, n);
    return 0;
}

void recorder_resume(void)
{
    leon3_console_off = kept.begun == BEGUN && leon3.link == leon3.console;
    if (kept.busy != 0u) {
        kept.status = MCAP_WRITE_FAILED;
    }
}

void recorder_begin(const MissionHost *host, const char *target)
{
    memset(&kept, 0, sizeof kept);
    leon3_console_off = leon3.link == leon3.console;
    kept.begun = BEGUN;
    kept.status = MCAP_FULL;
    if (host->n_schemas <= SCHEMAS && host->n_channels <= CHANNELS) {
        MissionHost here = *host;
        here.schemas = kept.schemas;
        here.channels = kept.channels;
        kept.status = mission_record_open(&kept.record, &here, send_record, NULL, target);
    }
}

void recorder_take(const MissionHost *host, int64_t t, const char *target)
{
    if (kept.begun != BEGUN) {
        recorder_begin(host, target);
    }
    if (kept.status == MCAP_OK) {
        kept.busy = 1u;
        kept.status = mission_record_take(&kept.record, host, t);
        kept.busy = 0u;
    }
    kept.taken++;
}

int recorder_end(const MissionIoCounts *counts)
{
    if (kept.begun == BEGUN && kept.status == MCAP_OK) {
        kept.status = mission_record_close(&kept.record);
    }
    leon3_console_off = 0;
    leon3_say_figure("recorded", kept.taken);
    leon3_say_figure("refused", counts->refused);
    leon3_say_figure("corrupt", counts->corrupt);
    leon3_say_figure("saturated", counts->saturated);
    leon3_say_figure("skipped", counts->skipped);
    leon3_say_figure("board_interrupts", leon3.heard);
    leon3_say_figure("program_bytes", leon3_program_size());
    leon3_say_figure("data_bytes", leon3_data_size());
    leon3_say_figure("ram_bytes", leon3_ram_used());
    leon3_say_figure("stack_bytes", leon3_stack_used());
    if (kept.status != MCAP_OK) {
        leon3_say("the record failed: ");
        leon3_say(kept.busy != 0u ? "the board was reset while it was sent" : mcap_status_text(kept.status));
        leon3_say("\n");
    }
    return kept.status == MCAP_OK ? 0 : 1;
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/bare/recorder.h"

#include "targets/bare/bare.h"

#include <string.h>

enum { BEGUN = 0x4d434150, NONE = -1 };

static RecorderKept *kept;

static int send_record(void *user, const void *bytes, size_t n)
{
    (void)user;
    bare_record(bytes, n);
    return 0;
}

static void forget(void)
{
    memset(kept, 0, sizeof *kept);
    kept->answered = NONE;
}

void recorder_resume(void)
{
    kept = kept != NULL ? kept : bare_keep(sizeof *kept);
    if (kept->begun != BEGUN) {
        forget();
    }
    bare_recording(kept->begun == BEGUN ? BARE_RECORD_GOES_ON : BARE_RECORD_ENDED);
    if (kept->busy != 0u) {
        kept->status = MCAP_WRITE_FAILED;
    }
}

void recorder_begin(const MissionHost *host, const char *target)
{
    forget();
    if (!bare_records()) {
        return;
    }
    bare_recording(BARE_RECORD_BEGINS);
    kept->begun = BEGUN;
    kept->status = MCAP_FULL;
    kept->busy = 1u;
    if (host->n_schemas <= RECORDER_SCHEMAS && host->n_channels <= RECORDER_CHANNELS) {
        MissionHost here = *host;
        here.schemas = kept->schemas;
        here.channels = kept->channels;
        kept->status = mission_record_open(&kept->record, &here, send_record, NULL, target);
        bare_record_flush();
    }
    kept->busy = 0u;
}

/* Whether a reset came between the answer to a tick and its record, if flight is now at t. */
static void look_for_gap(int64_t t)
{
    if (kept->answered != NONE && kept->answered != t) {
        kept->busy = 1u;
        kept->status = kept->status == MCAP_OK ? MCAP_WRITE_FAILED : kept->status;
    }
}

void recorder_answer(int64_t t)
{
    if (t < 0 || !bare_records()) {
        kept->begun = 0u; /* a record of this run is yet to begin */
    } else if (kept->begun == BEGUN) {
        look_for_gap(t);
        kept->answered = t;
    }
}

void recorder_take(const MissionHost *host, int64_t t, const char *target)
{
    if (!bare_records()) {
        return;
    }
    if (kept->begun != BEGUN) {
        recorder_begin(host, target);
    }
    if (kept->status == MCAP_OK) {
        kept->busy = 1u;
        kept->status = mission_record_take(&kept->record, host, t);
        bare_record_flush();
        kept->busy = 0u;
    }
    kept->answered = NONE;
    kept->taken++;
}

int recorder_end(const MissionIoCounts *counts)
{
    look_for_gap(NONE);
    if (kept->begun == BEGUN && kept->status == MCAP_OK && kept->closed == 0u) {
        kept->busy = 1u;
        kept->status = mission_record_close(&kept->record);
        bare_record_flush();
        kept->busy = 0u;
        kept->closed = 1u;
    }
    bare_recording(BARE_RECORD_ENDED);
    bare_say_figure("recorded", kept->taken);
    bare_say_figure("refused", counts->refused);
    bare_say_figure("corrupt", counts->corrupt);
    bare_say_figure("saturated", counts->saturated);
    bare_say_figure("skipped", counts->skipped);
    bare_say_figures();
    const int failed = kept->begun == BEGUN && kept->status != MCAP_OK;
    if (failed) {
        bare_say("the record failed: ");
        bare_say(kept->busy != 0u ? "the board was reset while it was sent" : mcap_status_text(kept->status));
        bare_say("\n");
    }
    return failed;
}

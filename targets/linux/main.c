/* SPDX-License-Identifier: Apache-2.0 */
/* An exported mission as a process of its own, which exchanges data only through a register file. By default the clock
 * of the registers paces flight, tick by tick. With --clock the machine's clock does, and flight reads the registers as
 * they are at that time. With --inputs a file plays the outside, at once or by the clock. The program writes the
 * outputs of flight into its own record.
 *
 * The loop does not allocate. At the end the program prints its results on the standard output, a key and a value on
 * each line. Exit codes: 0 flown to the end, 1 the register file or the record failed, 2 wrong options. */
#define _POSIX_C_SOURCE 200809L
#include "ccsds/store/posix_store.h"
#include "record/file_sink.h"
#include "registers/shared_file.h"
#include "targets/linux/crash.h"
#include "targets/linux/inputs.h"
#include "targets/linux/keys.h"
#include "targets/linux/pace.h"
#include "targets/mission_host.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SECOND INT64_C(1000000000)
#define POLL_NS (SECOND / 4) /* how often the program checks for signals while it waits */

enum { MARKS_MAX = 32, FLOWN = 0, FAILED = 1, CALLED_WRONGLY = 2 };

typedef struct Options {
    const char *registers; ///< the file, or NULL
    const char *record;    ///< the file, or NULL
    const char *inputs;    ///< the file, or NULL
    const char *files;     ///< the folder, or NULL
    const char *keys;      ///< the file, or NULL
    double wait;           ///< [s] how long to wait for the register file
    double duration;       ///< [s] with the machine's clock; 0: until a signal
    int priority;          ///< of SCHED_FIFO; 0: do not request it
    int clock;             ///< 1: the machine's clock paces flight
    int describe;          ///< 1: only print what the script composed
    const char *wrong;     ///< the wrong word, or NULL
} Options;

/** The heap of flight at some ticks, evenly spread over a run of any length. */
typedef struct HeapMarks {
    uint32_t every; ///< ticks
    uint32_t n;
    struct {
        uint32_t tick;
        uint32_t used, peak; ///< [bytes]
    } marks[MARKS_MAX];
} HeapMarks;

typedef struct Runner {
    RegisterFile file;
    RegisterWindow windows[MISSION_BOARDS_MAX];
    MissionIoCounts counts;
    FileSink sink;
    MissionRecord record;
    const RegisterWindow *clock; ///< the window of the board with the clock
    Inputs inputs;
#ifdef FLEDGE_FILES
    PosixStore folder;
    CfdpStore store;
#endif
    volatile int64_t now; ///< [ns] of the present exchange
    int64_t cpu;          ///< [ns] of all exchanges
    int64_t faults;
    uint32_t ticks;
    uint32_t overruns;
    int recording;
    PaceHistogram late, cycle_cpu, cycle_wall;
    HeapMarks heap;
} Runner;

static Runner runner;
static volatile sig_atomic_t stopped;

static void stop(int signal_number)
{
    (void)signal_number;
    stopped = 1;
}

static int complain(const char *subject, const char *why)
{
    (void)fprintf(stderr, "%s: %s: %s\n", fledge_mission.name, subject, why);
    return FAILED;
}

/* ---- the command line */

static const char usage[] =
    "usage: %s [--record FILE] [--files FOLDER] [--wait S] REGISTERS        paced by the registers' clock\n"
    "       %s --clock [--priority N] [--for S] [--record FILE] [--files FOLDER] [--wait S] [REGISTERS]\n"
    "       %s --inputs FILE [--clock [--priority N]] [--for S] [--record FILE] [--files FOLDER]\n"
    "\n"
    "REGISTERS is the register file of the boards, or /dev/fd/N; --clock works without it.\n"
    "  --record FILE   write all outputs of flight into an MCAP file\n"
#ifdef FLEDGE_FILES
    "  --files FOLDER  where flight keeps files; default: in its memory\n"
#endif
    "  --wait S        how long to wait for the register file; default: 10\n"
    "  --clock         pace flight by this machine's clock, in real time\n"
    "  --priority N    of SCHED_FIFO, 1 to 99; default: 50; 0: do not request it\n"
    "  --inputs FILE   what flight reads, of an earlier run; without --clock as fast as possible\n"
#ifdef FLEDGE_LINK_KEYS
    "  --keys FILE     of the secured link, which only its owner may read\n"
#endif
    "  --describe      only print what the mission's script composed, if it has one\n"
    "  --for S         end after S seconds; default: after a signal, or the last of the inputs\n";

static int number(const char *text, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return *text != '\0' && *end == '\0' && *value >= 0.0 && *value < 1e9;
}

static int read_options(Options *o, int n, char **words)
{
    memset(o, 0, sizeof *o);
    o->wait = 10.0;
    o->priority = 50;
    for (int i = 1; i < n; i++) {
        const char *word = words[i];
        o->wrong = word;
        double value = 0.0;
        if (strcmp(word, "--clock") == 0) {
            o->clock = 1;
        } else if (strcmp(word, "--describe") == 0 && fledge_mission.describe != NULL) {
            o->describe = 1;
        } else if (strncmp(word, "--", 2) == 0) {
            if (i + 1 >= n) {
                return 0;
            }
            i++;
            if (strcmp(word, "--record") == 0) {
                o->record = words[i];
#ifdef FLEDGE_LINK_KEYS
            } else if (strcmp(word, "--keys") == 0) {
                o->keys = words[i];
#endif
#ifdef FLEDGE_FILES
            } else if (strcmp(word, "--files") == 0) {
                o->files = words[i];
#endif
            } else if (strcmp(word, "--inputs") == 0) {
                o->inputs = words[i];
            } else if (strcmp(word, "--wait") == 0 && number(words[i], &value)) {
                o->wait = value;
            } else if (strcmp(word, "--for") == 0 && number(words[i], &value)) {
                o->duration = value;
            } else if (strcmp(word, "--priority") == 0 && number(words[i], &value) && value < 100.0) {
                o->priority = (int)value;
            } else {
                return 0;
            }
        } else if (o->registers == NULL) {
            o->registers = word;
        } else {
            return 0;
        }
    }
    o->wrong = o->inputs != NULL && o->registers != NULL ? o->registers : NULL;
    return o->wrong == NULL && (o->clock || o->describe || o->inputs != NULL || o->registers != NULL);
}

/* ---- set-up and end */

static int attach(const Options *o)
{
    const MissionIo *io = fledge_mission.io;
    RegisterFileStatus status;
    if (io->n_boards > MISSION_BOARDS_MAX) {
        return complain("boards", "there are more than 4");
    }
    if (o->registers == NULL) {
        status = register_file_create(&runner.file, NULL, io->boards, io->n_boards, runner.windows);
    } else {
        const int64_t end = pace_now() + (int64_t)(o->wait * 1e9);
        do {
            status = register_file_attach(&runner.file, o->registers, io->boards, io->n_boards, runner.windows);
        } while (status == REGISTER_FILE_NOT_YET && !stopped && pace_now() < end &&
                 (pace_sleep(pace_now() + SECOND / 1000) == 0 || !stopped));
    }
    if (status != REGISTER_FILE_OK) {
        const char *name = o->registers != NULL ? o->registers : "registers";
        return complain(name, status == REGISTER_FILE_FAILED ? strerror(runner.file.error)
                                                             : register_file_status_text(status));
    }
    runner.clock = &runner.windows[mission_io_clock(io)];
    const char *wrong = o->inputs != NULL ? inputs_open(&runner.inputs, o->inputs, io) : NULL;
    return wrong != NULL ? complain(o->inputs, wrong) : FLOWN;
}

/* Without a folder flight keeps files in its memory. */
static int open_files(const char *folder)
{
#ifdef FLEDGE_FILES
    if (folder == NULL) {
        return FLOWN;
    }
    if (!posix_store_open(&runner.folder, folder, INT64_MAX, &runner.store)) {
        return complain(folder, strerror(errno));
    }
    *fledge_mission.store = &runner.store;
#else
    (void)folder;
#endif
    return FLOWN;
}

/* Without them a secured link carries nothing. By the machine's clock, flight's time begins anew with the program. */
static int read_keys(const Options *o)
{
#ifdef FLEDGE_LINK_KEYS
    char why[400];
    if (o->keys == NULL) {
        return complain("--keys FILE", "the link of this mission is secured; give its file of keys");
    }
    *fledge_mission.keys = keys_read(o->keys, o->clock ? pace_date() : 0, why, sizeof why);
    if (*fledge_mission.keys == NULL) {
        return complain("keys", why);
    }
#else
    (void)o;
#endif
    return FLOWN;
}

static int open_record(const char *path)
{
    if (file_sink_open(&runner.sink, path) != 0) {
        return complain(path, strerror(runner.sink.error));
    }
    runner.recording = 1;
    const McapStatus status =
        mission_record_open(&runner.record, &fledge_mission, file_sink_write, &runner.sink, "linux");
    return status == MCAP_OK ? FLOWN : complain(path, mcap_status_text(status));
}

/* The record gets its final name only if the run ended well; else it stays FILE.part. */
static int close_record(const char *path, int whole)
{
    const McapStatus status = mission_record_close(&runner.record);
    runner.recording = 0;
    const int error = file_sink_close(&runner.sink, whole && status == MCAP_OK);
    if (error != 0) {
        return complain(path, strerror(error));
    }
    return status == MCAP_OK ? FLOWN : complain(path, mcap_status_text(status));
}

static void print_line(const char *text)
{
    (void)puts(text);
}

/* Print figures of durations, and how many each bin has: "up to:how many". */
static void report_durations(const char *name, const PaceHistogram *h)
{
    printf("%s_least %" PRId64 "\n%s_median %" PRId64 "\n%s_p99 %" PRId64 "\n%s_most %" PRId64 "\n%s_histogram", name,
           h->least, name, pace_quantile(h, 0.5), name, pace_quantile(h, 0.99), name, h->most, name);
    for (uint32_t i = 0u; i < PACE_BINS; i++) {
        if (h->bins[i] > 0u) {
            printf(" %" PRId64 ":%" PRIu32, pace_bin_end(i), h->bins[i]);
        }
    }
    printf("\n");
}

static void report(const Options *o, int no_fifo, int no_lock)
{
    const double mean = runner.ticks > 0u ? (double)runner.cpu / runner.ticks : 0.0;
    printf("ticks %" PRIu32 "\ncpu_ns %.0f\n", runner.ticks, mean);
    printf("refused %" PRIu32 "\ncorrupt %" PRIu32 "\nsaturated %" PRIu32 "\nskipped %" PRIu32 "\n",
           runner.counts.refused, runner.counts.corrupt, runner.counts.saturated, runner.counts.skipped);
    report_durations("cycle_cpu_ns", &runner.cycle_cpu);
    report_durations("cycle_wall_ns", &runner.cycle_wall);
    if (fledge_mission.heap != NULL) {
        printf("heap");
        for (uint32_t i = 0u; i < runner.heap.n; i++) {
            printf(" %" PRIu32 ":%" PRIu32 ":%" PRIu32, runner.heap.marks[i].tick, runner.heap.marks[i].used,
                   runner.heap.marks[i].peak);
        }
        printf("\n");
    }
    if (fledge_mission.figures != NULL) {
        fledge_mission.figures(print_line);
    }
    if (!o->clock) {
        return;
    }
    report_durations("late_ns", &runner.late);
    printf("overruns %" PRIu32 "\nfaults %" PRId64 "\n", runner.overruns, runner.faults);
    if (o->priority == 0) {
        printf("scheduling shared, as requested\n");
    } else if (no_fifo != 0) {
        printf("scheduling shared, not real-time: the system refused SCHED_FIFO (%s)\n", strerror(no_fifo));
    } else {
        printf("scheduling SCHED_FIFO %d\n", o->priority);
    }
    if (no_lock != 0) {
        printf("memory not locked: the system refused mlockall (%s)\n", strerror(no_lock));
    } else {
        printf("memory locked\n");
    }
}

/* ---- the loop, which neither allocates nor prints */

/* When there is no room, every second mark goes, and from then on half as many come. */
static void mark_heap(void)
{
    HeapMarks *h = &runner.heap;
    if (fledge_mission.heap == NULL || runner.ticks % h->every != 0u) {
        return;
    }
    if (h->n == MARKS_MAX) {
        for (uint32_t i = 0u; i < MARKS_MAX / 2; i++) {
            h->marks[i] = h->marks[2u * i];
        }
        h->n = MARKS_MAX / 2;
        h->every *= 2u;
    }
    const MissionHeap heap = fledge_mission.heap();
    h->marks[h->n].tick = runner.ticks;
    h->marks[h->n].used = (uint32_t)heap.used;
    h->marks[h->n].peak = (uint32_t)heap.peak;
    h->n++;
}

/* Make one exchange, measure its time, and record the outputs. */
static int exchange(int64_t t)
{
    const int64_t start = pace_now();
    const int64_t start_cpu = pace_cpu();
    runner.now = t;
    mission_host_exchange(&fledge_mission, runner.windows, t, &runner.counts);
    if (t < 0) {
        mark_heap();
        return FLOWN;
    }
    const int64_t cpu = pace_cpu() - start_cpu;
    pace_note(&runner.cycle_cpu, cpu);
    pace_note(&runner.cycle_wall, pace_now() - start);
    runner.cpu += cpu;
    runner.ticks++;
    mark_heap();
    return !runner.recording || mission_record_take(&runner.record, &fledge_mission, t) == MCAP_OK ? FLOWN : FAILED;
}

/* Fly tick by tick, paced by the clock of the registers. */
static int fly_by_ticks(void)
{
    while (!stopped) {
        Tick tick;
        if (register_clock_due(runner.clock, &tick)) {
            if (exchange(tick.t) != FLOWN) {
                return complain("record", mcap_status_text(runner.record.writer.status));
            }
            register_clock_finish(runner.clock);
        } else if (register_clock_stopped(runner.clock)) {
            return FLOWN;
        } else if (register_file_wait(&runner.file, POLL_NS) == REGISTER_FILE_GONE &&
                   !register_clock_stopped(runner.clock)) {
            return complain("registers", "the outside has disappeared before it ended the run");
        }
    }
    return complain("registers", "a signal stopped the program before the outside ended the run");
}

static int64_t next_instant(const Options *o)
{
    return o->inputs != NULL ? inputs_next(&runner.inputs) : fledge_mission.next();
}

/* Fly by the clock of this machine, or as fast as possible. Time 0 is 10 ms from now. */
static int fly_alone(const Options *o)
{
    const int64_t start = pace_now() + SECOND / 100;
    const int64_t end = o->duration > 0.0 ? (int64_t)(o->duration * 1e9) : INT64_MAX / 2;
    if (exchange(-1) != FLOWN) {
        return FAILED;
    }
    for (int64_t t = next_instant(o); t <= end && !stopped; t = next_instant(o)) {
        if (o->clock) {
            if (pace_sleep(start + t) != 0) {
                continue;
            }
            pace_note(&runner.late, pace_now() - (start + t));
        }
        if (register_clock_stopped(runner.clock)) {
            break;
        }
        if (o->inputs != NULL) {
            inputs_put(&runner.inputs, fledge_mission.io, runner.windows, &runner.counts);
        }
        if (exchange(t) != FLOWN) {
            return complain("record", mcap_status_text(runner.record.writer.status));
        }
        runner.overruns += o->clock && pace_now() - start > next_instant(o);
    }
    return FLOWN;
}

int main(int argc, char **argv)
{
    Options options;
    struct sigaction action;
    int no_fifo = 0, no_lock = 0;
    if (!read_options(&options, argc, argv)) {
        if (options.wrong != NULL) {
            (void)fprintf(stderr, "%s: cannot use %s here, or its value is wrong\n", argv[0], options.wrong);
        }
        (void)fprintf(stderr, usage, argv[0], argv[0], argv[0]);
        return CALLED_WRONGLY;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    action.sa_handler = SIG_IGN; /* a record that reaches the limit on file sizes is an error of writing */
    (void)sigaction(SIGXFSZ, &action, NULL);

    if (fledge_mission.clock != NULL) {
        *fledge_mission.clock = pace_now;
    }
    runner.now = -1;
    crash_report(fledge_mission.name, argv, &runner.now);
    fledge_mission.init();
    if (fledge_mission.failure != NULL && fledge_mission.failure() != NULL) {
        return complain("script", fledge_mission.failure());
    }
    if (options.describe) {
        fledge_mission.describe(print_line);
        return FLOWN;
    }
    int result = open_files(options.files);
    if (result == FLOWN) {
        result = read_keys(&options);
    }
    if (result == FLOWN && options.record != NULL) {
        result = open_record(options.record);
    }
    if (result == FLOWN) {
        result = attach(&options);
    }
    runner.heap.every = 1u;
    if (result == FLOWN && options.clock) {
        no_lock = pace_lock_memory();
        pace_prefault();
        no_fifo = options.priority > 0 ? pace_real_time(options.priority) : 0;
        runner.faults = -pace_faults();
    }
    if (result == FLOWN && (options.clock || options.inputs != NULL)) {
        result = fly_alone(&options);
        runner.faults += pace_faults();
    } else if (result == FLOWN) {
        result = fly_by_ticks();
    }
    if (runner.recording) {
        const int closed = close_record(options.record, result == FLOWN);
        result = result != FLOWN ? result : closed;
    }
    if (runner.clock != NULL) {
        register_file_close(&runner.file);
        report(&options, no_fifo, no_lock);
    }
    return result;
}

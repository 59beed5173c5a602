/* SPDX-License-Identifier: Apache-2.0 */
/* An exported mission as a process of its own, which exchanges data only through a register file. By default the clock
 * of the registers paces flight, tick by tick. With --clock the machine's clock does, and flight reads the registers as
 * they are at that time. The program writes the outputs of flight into its own record.
 *
 * The loop does not allocate. At the end the program prints its results on the standard output, a key and a value on
 * each line. Exit codes: 0 flown to the end, 1 the register file or the record failed, 2 wrong options. */
#define _POSIX_C_SOURCE 200809L
#include "record/file_sink.h"
#include "registers/shared_file.h"
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

enum { BOARDS_MAX = 4, FLOWN = 0, FAILED = 1, CALLED_WRONGLY = 2 };

typedef struct Options {
    const char *registers; ///< the file, or NULL
    const char *record;    ///< the file, or NULL
    double wait;           ///< [s] how long to wait for the register file
    double duration;       ///< [s] with the machine's clock; 0: until a signal
    int priority;          ///< of SCHED_FIFO; 0: do not request it
    int clock;             ///< 1: the machine's clock paces flight
    int describe;          ///< 1: only print what the script composed
    const char *wrong;     ///< the wrong word, or NULL
} Options;

typedef struct Runner {
    RegisterFile file;
    RegisterWindow windows[BOARDS_MAX];
    MissionIoCounts counts;
    FileSink sink;
    MissionRecord record;
    const RegisterWindow *clock; ///< the window of the board with the clock
    int64_t cpu;                 ///< [ns] of all exchanges
    int64_t cpu_most;
    uint32_t ticks;
    uint32_t overruns;
    int recording;
    PaceHistogram late;
} Runner;

static Runner runner;
static volatile sig_atomic_t stopped;

static void stop(int signal_number)
{
    (void)signal_number;
    stopped = 1;
}

static int complain(const char *what, const char *why)
{
    (void)fprintf(stderr, "%s: %s: %s\n", fledge_mission.name, what, why);
    return FAILED;
}

/* ---- the command line */

static const char usage[] = "usage: %s [--record FILE] [--wait S] REGISTERS        paced by the registers' clock\n"
                            "       %s --clock [--priority N] [--for S] [--record FILE] [--wait S] [REGISTERS]\n"
                            "\n"
                            "REGISTERS is the register file of the boards, or /dev/fd/N; --clock works without it.\n"
                            "  --record FILE   write all outputs of flight into an MCAP file\n"
                            "  --wait S        how long to wait for the register file; default: 10\n"
                            "  --clock         pace flight by this machine's clock, in real time\n"
                            "  --priority N    of SCHED_FIFO, 1 to 99; default: 50; 0: do not request it\n"
                            "  --describe      only print what the mission's script composed, if it has one\n"
                            "  --for S         end after S seconds; default: after a signal\n";

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
    o->wrong = NULL;
    return o->clock || o->describe || o->registers != NULL;
}

/* ---- set-up and end */

static int attach(const Options *o)
{
    const MissionIo *io = fledge_mission.io;
    RegisterFileStatus status;
    if (io->n_boards > BOARDS_MAX) {
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

static void report(const Options *o, int no_fifo, int no_lock)
{
    const double mean = runner.ticks > 0u ? (double)runner.cpu / runner.ticks : 0.0;
    printf("ticks %" PRIu32 "\ncpu_ns %.0f\ncpu_ns_most %" PRId64 "\n", runner.ticks, mean, runner.cpu_most);
    printf("refused %" PRIu32 "\ncorrupt %" PRIu32 "\nsaturated %" PRIu32 "\nskipped %" PRIu32 "\n",
           runner.counts.refused, runner.counts.corrupt, runner.counts.saturated, runner.counts.skipped);
    if (!o->clock) {
        return;
    }
    printf("late_ns_least %" PRId64 "\nlate_ns_median %" PRId64 "\nlate_ns_p99 %" PRId64 "\nlate_ns_most %" PRId64
           "\noverruns %" PRIu32 "\n",
           runner.late.least, pace_quantile(&runner.late, 0.5), pace_quantile(&runner.late, 0.99), runner.late.most,
           runner.overruns);
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

/* Make one exchange, measure its processor time, and record the outputs. */
static int exchange(int64_t t)
{
    const int64_t start = pace_cpu();
    mission_host_exchange(&fledge_mission, runner.windows, t, &runner.counts);
    if (t < 0) {
        return FLOWN;
    }
    const int64_t cpu = pace_cpu() - start;
    runner.cpu += cpu;
    runner.cpu_most = cpu > runner.cpu_most ? cpu : runner.cpu_most;
    runner.ticks++;
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

/* Fly by the clock of this machine. Time 0 is 10 ms from now. */
static int fly_by_clock(double duration)
{
    const int64_t start = pace_now() + SECOND / 100;
    const int64_t end = duration > 0.0 ? (int64_t)(duration * 1e9) : INT64_MAX;
    if (exchange(-1) != FLOWN) {
        return FAILED;
    }
    for (int64_t t = fledge_mission.next(); t <= end && !stopped; t = fledge_mission.next()) {
        if (pace_sleep(start + t) != 0) {
            continue;
        }
        pace_note(&runner.late, pace_now() - (start + t));
        if (register_clock_stopped(runner.clock)) {
            break;
        }
        if (exchange(t) != FLOWN) {
            return complain("record", mcap_status_text(runner.record.writer.status));
        }
        runner.overruns += pace_now() > start + fledge_mission.next();
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
        (void)fprintf(stderr, usage, argv[0], argv[0]);
        return CALLED_WRONGLY;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    action.sa_handler = SIG_IGN; /* a record that reaches the limit on file sizes is an error of writing */
    (void)sigaction(SIGXFSZ, &action, NULL);

    fledge_mission.init();
    if (fledge_mission.failure != NULL && fledge_mission.failure() != NULL) {
        return complain("script", fledge_mission.failure());
    }
    if (options.describe) {
        fledge_mission.describe(print_line);
        return FLOWN;
    }
    int result = options.record != NULL ? open_record(options.record) : FLOWN;
    if (result == FLOWN) {
        result = attach(&options);
    }
    if (result == FLOWN && options.clock) {
        no_lock = pace_lock_memory();
        no_fifo = options.priority > 0 ? pace_real_time(options.priority) : 0;
        result = fly_by_clock(options.duration);
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

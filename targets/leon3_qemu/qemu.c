/* SPDX-License-Identifier: Apache-2.0 */
/* A LEON3 program on stock QEMU, as a second opinion on the emulator. QEMU has no register space: the guest searches
 * it at the end of its RAM, which is a file that this program maps too. At each tick this program copies the boards of
 * the register file there, waits until the guest has answered, and copies them back.
 *
 * Both the record and the console of the guest come through its only UART, one behind the other: the record first. Exit
 * codes: 0 flown to the end, 1 something failed, 2 wrong arguments. */
#define _GNU_SOURCE /* memfd_create */
#include "registers/plug_and_play.h"
#include "registers/shared_file.h"
#include "targets/mission_host.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { MIB = 1 << 20 };
#define POLL_NS 250000000 /* how often the program looks for signals while it waits */
#define TRIES 4000        /* looks at the guest's answer between two looks at QEMU itself */

static volatile sig_atomic_t stopped;
static RegisterFile file;
static RegisterWindow outside[MISSION_BOARDS_MAX], guest[MISSION_BOARDS_MAX];
static uint8_t *ram;
static size_t ram_size;
static pid_t qemu;
static int64_t spent; /* [ns] from ticks to answers */
static uint32_t ticks;

static void stop(int number)
{
    (void)number;
    stopped = 1;
}

static int fail(const char *subject, const char *why)
{
    (void)fprintf(stderr, "%s: %s: %s\n", fledge_mission.name, subject, why);
    return 1;
}

static int64_t now(void)
{
    struct timespec t = {0, 0};
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

/* ---- the boards, in the file and in the RAM of the guest */

/* Returns 0 if a board does not lie within the last MiB of the RAM. */
static int place_windows(void)
{
    const MissionIo *io = fledge_mission.io;
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        const uint64_t at = register_bus_offset(io->boards, io->n_boards, io->boards[i]);
        if (at + io->boards[i]->size > MIB) {
            return 0;
        }
        guest[i] = register_window(io->boards[i], (volatile uint32_t *)(void *)(ram + ram_size - MIB + at));
    }
    return 1;
}

/* All words but those of the clock, from one side to the other. */
static void copy_boards(const RegisterWindow *from, const RegisterWindow *to)
{
    for (uint32_t i = 0u; i < fledge_mission.io->n_boards; i++) {
        const RegisterBoard *board = from[i].board;
        for (uint32_t at = 0u; at < board->size; at += 4u) {
            if (at - board->clock >= REGISTER_CLOCK_SIZE) {
                to[i].words[at / 4u] = from[i].words[at / 4u];
            }
        }
    }
}

static int has_ended(int *status)
{
    return qemu <= 0 || (waitpid(qemu, status, WNOHANG) == qemu && (qemu = -1));
}

/* Fly one tick in the guest. Returns 0 if QEMU has ended. */
static int exchange(uint32_t clock, Tick tick)
{
    const struct timespec nap = {0, 1000};
    int status;
    copy_boards(outside, guest);
    register_store(&guest[clock], outside[clock].board->clock + REGISTER_CLOCK_RESET,
                   register_clock_resets(&outside[clock]));
    const int64_t begin = now();
    register_clock_start(&guest[clock], tick);
    while (!register_clock_is_done(&guest[clock])) {
        for (int i = 0; i < TRIES && !register_clock_is_done(&guest[clock]); i++) {
            (void)nanosleep(&nap, NULL);
        }
        if (stopped || (!register_clock_is_done(&guest[clock]) && has_ended(&status))) {
            return 0;
        }
    }
    if (tick.t >= 0) {
        spent += now() - begin;
        ticks++;
    }
    copy_boards(guest, outside);
    register_clock_finish(&outside[clock]);
    return 1;
}

static int fly(uint32_t clock)
{
    int status = 0;
    while (!stopped) {
        Tick tick;
        if (register_clock_due(&outside[clock], &tick)) {
            if (!exchange(clock, tick)) {
                return stopped ? fail("QEMU", "a signal stopped the program before the outside ended the run")
                               : fail("QEMU", "it has ended before the run");
            }
        } else if (register_clock_stopped(&outside[clock])) {
            register_clock_stop(&guest[clock]);
            if (waitpid(qemu, &status, 0) != qemu) {
                return fail("QEMU", strerror(errno));
            }
            qemu = -1;
            return status == 0 ? 0 : fail("QEMU", "it has failed");
        } else if (register_file_wait(&file, POLL_NS) == REGISTER_FILE_GONE &&
                   !register_clock_stopped(&outside[clock])) {
            return fail("registers", "the outside has disappeared before it ended the run");
        } else if (has_ended(&status)) {
            return fail("QEMU", "it has ended before the run");
        }
    }
    return fail("registers", "a signal stopped the program before the outside ended the run");
}

/* ---- QEMU and what comes through its UART */

static int start(const char *program, const char *serial)
{
    const pid_t parent = getpid();
    char memory[128], size[32], file_of[528];
    const int fd = memfd_create("ram", 0);
    if (fd < 0 || ftruncate(fd, (off_t)ram_size) != 0) {
        return fail("memory", strerror(errno));
    }
    ram = mmap(NULL, ram_size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (ram == MAP_FAILED) {
        return fail("memory", strerror(errno));
    }
    (void)snprintf(memory, sizeof memory, "memory-backend-file,id=ram,share=on,mem-path=/dev/fd/%d,size=%zu", fd,
                   ram_size);
    (void)snprintf(size, sizeof size, "%zuM", ram_size / MIB);
    (void)snprintf(file_of, sizeof file_of, "file:%s", serial);
    qemu = fork();
    if (qemu == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() == parent) {
            (void)execlp("qemu-system-sparc", "qemu-system-sparc", "-M", "leon3_generic,memory-backend=ram", "-object",
                         memory, "-m", size, "-display", "none", "-monitor", "none", "-serial", file_of, "-kernel",
                         program, (char *)NULL);
            (void)fprintf(stderr, "qemu-system-sparc cannot be started: %s\n", strerror(errno));
        }
        _exit(127);
    }
    (void)close(fd);
    return qemu > 0 ? 0 : fail("QEMU", strerror(errno));
}

/* The record is what comes before the console's text: it ends with the mark of MCAP. */
static int split(const char *serial, const char *record)
{
    static const char mark[8] = {'\x89', 'M', 'C', 'A', 'P', '0', '\r', '\n'};
    static char tail[4096];
    FILE *f = fopen(serial, "r+");
    if (f == NULL || fseek(f, 0, SEEK_END) != 0) {
        return fail(serial, strerror(errno));
    }
    const long size = ftell(f), from = size > (long)sizeof tail ? size - (long)sizeof tail : 0;
    (void)fseek(f, from, SEEK_SET);
    const size_t n = fread(tail, 1, sizeof tail, f);
    const char *end = NULL, *fault = NULL;
    for (size_t i = 0; i + sizeof mark <= n; i++) {
        end = memcmp(tail + i, mark, sizeof mark) == 0 ? tail + i + sizeof mark : end;
        fault = memcmp(tail + i, "trap 0x", 7) == 0 ? tail + i : fault;
    }
    const int whole = end != NULL && fault == NULL && from + (end - tail) > (long)sizeof mark;
    const char *text = whole ? end : fault;
    if (text != NULL) {
        (void)fwrite(text, 1, n - (size_t)(text - tail), stdout);
    }
    const int failed = whole && (ftruncate(fileno(f), from + (end - tail)) != 0 || rename(serial, record) != 0);
    (void)fclose(f);
    return failed ? fail(record, strerror(errno)) : whole ? 0 : fail(serial, "the guest did not end its record");
}

int main(int argc, char **argv)
{
    const MissionIo *io = fledge_mission.io;
    const uint32_t clock = mission_io_clock(io);
    char serial[512];
    struct sigaction action;
    if (argc != 5 || (ram_size = strtoul(argv[2], NULL, 0)) < 2u * MIB || ram_size % MIB != 0u) {
        (void)fprintf(stderr, "usage: %s PROGRAM RAM_BYTES RECORD REGISTERS\n", argv[0]);
        return 2;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)snprintf(serial, sizeof serial, "%s.part", argv[3]);
    if (io->n_boards > MISSION_BOARDS_MAX) {
        return fail("boards", "there are more than 4");
    }
    const RegisterFileStatus attached = register_file_attach(&file, argv[4], io->boards, io->n_boards, outside);
    if (attached != REGISTER_FILE_OK) {
        return fail(argv[4], register_file_status_text(attached));
    }
    int result = start(argv[1], serial);
    if (result == 0) {
        result = place_windows() ? fly(clock) : fail("boards", "they need more than 1 MiB from the lowest base on");
        if (qemu > 0) {
            (void)kill(qemu, SIGKILL);
            (void)waitpid(qemu, NULL, 0);
        }
        const int wrong = split(serial, argv[3]);
        result = result != 0 ? result : wrong;
    }
    register_file_close(&file);
    (void)printf("ticks %" PRIu32 "\ncpu_ns %.0f\n", ticks, (double)spent / (ticks > 0u ? ticks : 1u));
    return result;
}

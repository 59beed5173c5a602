/* SPDX-License-Identifier: Apache-2.0 */
/* A POSIX program that hosts apps on the pocket cFE. It starts the apps of the start-up script, whose entry points are
 * in the linked table fledge_apps. It ends when no app runs any more, or after SIGINT or SIGTERM.
 *
 * With --ground, each line of hex digits on the standard input is a packet for the bus. The program prints the packets
 * to which it listens on the standard output, as lines "TLM ...". Exit codes: 0 all apps ended well, 1 an app failed,
 * 2 wrong options. */
#define _POSIX_C_SOURCE 200809L
#include "targets/cfs/pocket.h"

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define LISTENED_MAX 96
#define LINE_MAX_BYTES 8192
#define POLL_MS 5

extern const PocketApp fledge_apps[];
extern const uint32 fledge_apps_n;

static volatile sig_atomic_t stopped;
static uint32 listened[LISTENED_MAX];
static uint32 n_listened;
static CFE_SB_PipeId_t ground_pipe; /* of the listened ids */

static void stop(int signal_number)
{
    (void)signal_number;
    stopped = 1;
}

static const char usage[] = "usage: %s [--root DIR] [--script FILE] [--quiet] [--ground [--listen IDS] [--hold]]\n"
                            "\n"
                            "  --root DIR      the folder that holds cf, with tables, and ram; default: .\n"
                            "  --script FILE   default: /cf/cfe_es_startup.scr\n"
                            "  --quiet         print no events\n"
                            "  --ground        read and print packets as lines of hex digits; the line `restart NAME`\n"
                            "                  restarts an app, `met SECONDS` sets the mission elapsed time\n"
                            "  --listen IDS    print packets of these ids: 0x08C0,0x08C1 or a range 0x08C0-0x08C9\n"
                            "  --hold          let the apps continue after their start-up only after the line `go`\n";

static int read_ids(const char *text)
{
    while (*text != '\0') {
        char *end;
        const unsigned long first = strtoul(text, &end, 0);
        unsigned long last = first;
        if (end == text) {
            return 0;
        }
        if (*end == '-') {
            text = end + 1;
            last = strtoul(text, &end, 0);
        }
        for (unsigned long id = first; id <= last; id++) {
            if (n_listened == LISTENED_MAX) {
                return 0;
            }
            listened[n_listened++] = (uint32)id;
        }
        text = *end == ',' ? end + 1 : end;
        if (*end != ',' && *end != '\0') {
            return 0;
        }
    }
    return 1;
}

/* ---- the ground */

static int digit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

static void command(const char *line)
{
    uint8 packet[LINE_MAX_BYTES / 2];
    size_t n = 0;
    while (digit(line[2 * n]) >= 0 && digit(line[2 * n + 1]) >= 0) {
        packet[n] = (uint8)(digit(line[2 * n]) * 16 + digit(line[2 * n + 1]));
        n++;
    }
    (void)pocket_ingest(packet, n);
}

/* Called before any app starts, so that it misses no packet. */
static CFE_Status_t listen_to_apps(void)
{
    CFE_Status_t status = CFE_SB_CreatePipe(&ground_pipe, 60, "GROUND");
    for (uint32 i = 0; i < n_listened && status == CFE_SUCCESS; i++) {
        status = CFE_SB_SubscribeEx(CFE_SB_ValueToMsgId(listened[i]), ground_pipe, CFE_SB_DEFAULT_QOS, 60);
    }
    return status;
}

/* The task that prints packets. */
static void send_to_ground(void)
{
    CFE_SB_Buffer_t *buffer;
    static char line[LINE_MAX_BYTES];
    static const char digits[] = "0123456789abcdef";
    while (CFE_SB_ReceiveBuffer(&buffer, ground_pipe, CFE_SB_PEND_FOREVER) == CFE_SUCCESS) {
        const uint8 *p = (const uint8 *)buffer;
        const size_t size = ((size_t)p[4] << 8 | p[5]) + 7u;
        for (size_t i = 0; i < size && 2u * i + 2u < sizeof line; i++) {
            line[2u * i] = digits[p[i] >> 4];
            line[2u * i + 1u] = digits[p[i] & 15u];
            line[2u * i + 2u] = '\0';
        }
        (void)printf("TLM %s\n", line);
        (void)fflush(stdout);
    }
}

/* Execute the lines of the standard input. Returns 0 at its end. */
static int read_ground(int *go)
{
    static char text[LINE_MAX_BYTES];
    static size_t n;
    const ssize_t more = read(STDIN_FILENO, text + n, sizeof text - 1u - n);
    if (more <= 0) {
        return 0;
    }
    n += (size_t)more;
    text[n] = '\0';
    for (char *end = strchr(text, '\n'); end != NULL; end = strchr(text, '\n')) {
        *end = '\0';
        if (strcmp(text, "go") == 0) {
            *go = 1;
        } else if (strncmp(text, "restart ", 8) == 0) {
            (void)pocket_restart_app(text + 8);
        } else if (strncmp(text, "met ", 4) == 0) {
            pocket_set_met((uint32)strtoul(text + 4, NULL, 10));
        } else {
            command(text);
        }
        n -= (size_t)(end + 1 - text);
        memmove(text, end + 1, n + 1u);
    }
    n = n == sizeof text - 1u ? 0u : n; /* drop a line that is too long */
    return 1;
}

/* ---- the program */

static void report(void)
{
    const PocketCounts c = pocket_counts();
    struct rusage use;
    memset(&use, 0, sizeof use);
    (void)getrusage(RUSAGE_SELF, &use);
    const double cpu = (double)(use.ru_utime.tv_sec + use.ru_stime.tv_sec) +
                       1e-6 * (double)(use.ru_utime.tv_usec + use.ru_stime.tv_usec);
    (void)printf("sent %u\nno_subscriber %u\noverflow %u\npipe_full %u\nno_buffer %u\n"
                 "bad_checksum %u\nshort_command %u\nno_packet %u\nevents %u\nerrors %u\n"
                 "table_commands %u\ntable_errors %u\ncpu_ns_total %.0f\nmemory_kb %ld\n",
                 c.sent, c.no_subscriber, c.overflow, c.pipe_full, c.no_buffer, c.bad_checksum, c.short_command,
                 c.no_packet, c.events, c.errors, c.table_commands, c.table_errors, 1e9 * cpu, use.ru_maxrss);
    (void)fflush(stdout);
}

int main(int argc, char **argv)
{
    const char *root = ".", *script = "/cf/cfe_es_startup.scr";
    int ground = 0, quiet = 0, go = 1;
    struct sigaction action;
    osal_id_t task;
    for (int i = 1; i < argc; i++) {
        const int more = i + 1 < argc;
        if (strcmp(argv[i], "--ground") == 0) {
            ground = 1;
        } else if (strcmp(argv[i], "--quiet") == 0) {
            quiet = 1;
        } else if (strcmp(argv[i], "--hold") == 0) {
            go = 0;
        } else if (more && strcmp(argv[i], "--root") == 0) {
            root = argv[++i];
        } else if (more && strcmp(argv[i], "--script") == 0) {
            script = argv[++i];
        } else if (!more || strcmp(argv[i], "--listen") != 0 || !read_ids(argv[++i])) {
            (void)fprintf(stderr, usage, argv[0]);
            return 2;
        }
    }
    if (!ground && (go == 0 || n_listened > 0u)) {
        (void)fprintf(stderr, usage, argv[0]);
        return 2;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);

    pocket_boot(root, fledge_apps, fledge_apps_n);
    pocket_quiet(quiet != 0);
    if (n_listened > 0u && (listen_to_apps() != CFE_SUCCESS ||
                            OS_TaskCreate(&task, "GROUND", send_to_ground, NULL, 16384, 100, 0) != OS_SUCCESS)) {
        (void)fprintf(stderr, "%s: there are too many ids to listen to\n", argv[0]);
        return 1;
    }
    if (pocket_run_script(script) < 0) {
        return 1;
    }
    while (pocket_running() > 0u && !stopped) {
        struct pollfd in = {STDIN_FILENO, POLLIN, 0};
        if (go == 1 && pocket_operational(0)) {
            go = 2;
        }
        if (poll(&in, ground ? 1u : 0u, POLL_MS) > 0) {
            ground = read_ground(&go);
        }
    }
    const int ended = pocket_stop(15000);
    report();
    return ended && pocket_counts().apps_failed == 0u ? 0 : 1;
}

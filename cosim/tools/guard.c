/* SPDX-License-Identifier: Apache-2.0 */
/* Runs one command, and leaves no process of it behind: fledge_guard -- COMMAND...
 *
 * The program that starts the guard holds its standard input open. When the input ends, because that program has
 * ended or was killed, the guard ends the command and all its descendants, first by SIGTERM, then by SIGKILL. It does
 * the same on SIGTERM, SIGINT and SIGHUP, and with the descendants of a command that has ended.
 *
 * - It finds all descendants, through any forks and sessions: the guard is their subreaper, so a process that loses
 *   its parent becomes the guard's child.
 * - If the guard itself is killed, the kernel kills the command, and its descendants go to the next subreaper above.
 * - The same works through ssh, which then holds the standard input.
 *
 * Exits as the command does; with 128 + N if that was killed by signal N; 127 if it cannot be started.
 */
#define _GNU_SOURCE
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { GRACE_MS = 5000, LOOK_MS = 20, KILLED_MS = 5000, MOST_PROCESSES = 65536 };

typedef struct {
    pid_t pid, parent;
    bool ours;
} Process;

static long long now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (long long)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

/* The parent of a process; 0 if it has gone or is dead. */
static pid_t parent_of(pid_t pid)
{
    char path[64], text[512];
    snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
    FILE *file = fopen(path, "re");
    if (!file) {
        return 0;
    }
    const size_t n = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[n] = '\0';
    /* "pid (name) state parent ...", where the name may hold anything. */
    const char *rest = strrchr(text, ')');
    char state = 0;
    int parent = 0;
    if (!rest || sscanf(rest + 1, " %c %d", &state, &parent) != 2 || state == 'Z' || state == 'X') {
        return 0;
    }
    return (pid_t)parent;
}

/* Send a signal to all living descendants. */
static void signal_descendants(int number)
{
    static Process all[MOST_PROCESSES];
    const pid_t self = getpid();
    size_t n = 0;
    DIR *proc = opendir("/proc");
    if (!proc) {
        return;
    }
    for (const struct dirent *entry; (entry = readdir(proc)) && n < MOST_PROCESSES;) {
        if (isdigit((unsigned char)entry->d_name[0])) {
            const pid_t pid = (pid_t)atol(entry->d_name);
            const pid_t parent = parent_of(pid);
            if (parent) {
                all[n++] = (Process){pid, parent, false};
            }
        }
    }
    closedir(proc);
    for (bool more = true; more;) {
        more = false;
        for (size_t i = 0; i < n; i++) {
            bool ours = all[i].parent == self;
            for (size_t j = 0; j < n && !ours; j++) {
                ours = all[j].ours && all[j].pid == all[i].parent;
            }
            if (ours && !all[i].ours) {
                all[i].ours = more = true;
                kill(all[i].pid, number);
            }
        }
    }
}

/* Reap all children that have ended. `result` is set if the command is among them. False: there are no children. */
static bool reap(pid_t command, int *result, bool *ended)
{
    int status = 0;
    pid_t pid;
    while ((pid = waitpid(-1, &status, WNOHANG)) > 0) {
        if (pid == command) {
            *result = status;
            *ended = true;
        }
    }
    return pid == 0 || errno != ECHILD;
}

/* End all descendants: ask them to, wait, kill. */
static void end_all(pid_t command, int *result, bool *ended)
{
    const long long begun = now_ms();
    for (bool terminated = false; reap(command, result, ended); terminated = true) {
        const long long spent = now_ms() - begun;
        if (spent > GRACE_MS + KILLED_MS) {
            fprintf(stderr, "fledge_guard: some descendants of the command cannot be killed\n");
            return;
        }
        if (spent >= GRACE_MS) {
            signal_descendants(SIGKILL); /* again and again: they may fork meanwhile */
        } else if (!terminated) {
            signal_descendants(SIGTERM);
            signal_descendants(SIGCONT); /* a stopped process does not handle SIGTERM */
        }
        poll(NULL, 0, LOOK_MS);
    }
}

static pid_t start(char **command, const sigset_t *before)
{
    const pid_t parent = getpid();
    const pid_t pid = fork();
    if (pid != 0) {
        return pid;
    }
    setsid(); /* Ctrl-C is for the program that started the guard, and ends it in order */
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) {
        _exit(127);
    }
    sigprocmask(SIG_SETMASK, before, NULL);
    if (!freopen("/dev/null", "r", stdin)) {
        _exit(127);
    }
    execvp(command[0], command);
    fprintf(stderr, "fledge_guard: cannot start %s: %s\n", command[0], strerror(errno));
    _exit(127);
}

int main(int argc, char **argv)
{
    if (argc < 3 || strcmp(argv[1], "--") != 0) {
        fprintf(stderr, "usage: fledge_guard -- COMMAND [ARGUMENTS]\n"
                        "Runs a command, and ends all that it has started when standard input ends.\n");
        return 2;
    }
    sigset_t ours, before;
    sigemptyset(&ours);
    const int handled[] = {SIGCHLD, SIGTERM, SIGINT, SIGHUP};
    for (size_t i = 0; i < sizeof handled / sizeof *handled; i++) {
        sigaddset(&ours, handled[i]);
    }
    sigprocmask(SIG_BLOCK, &ours, &before);
    const int signals = signalfd(-1, &ours, SFD_CLOEXEC | SFD_NONBLOCK);
    prctl(PR_SET_CHILD_SUBREAPER, 1);
    const pid_t command = signals < 0 ? -1 : start(argv + 2, &before);
    if (command < 0) {
        fprintf(stderr, "fledge_guard: cannot start %s: %s\n", argv[2], strerror(errno));
        return 127;
    }

    int result = 0;
    bool ended = false, end_requested = false;
    struct pollfd watched[] = {{.fd = STDIN_FILENO, .events = POLLIN}, {.fd = signals, .events = POLLIN}};
    while (!ended && !end_requested) {
        poll(watched, 2, -1);
        if (watched[0].revents) {
            char heap[256];
            end_requested = read(STDIN_FILENO, heap, sizeof heap) <= 0;
        }
        struct signalfd_siginfo signal;
        while (read(signals, &signal, sizeof signal) == (ssize_t)sizeof signal) {
            end_requested = end_requested || signal.ssi_signo != SIGCHLD;
        }
        reap(command, &result, &ended);
    }
    end_all(command, &result, &ended);
    return !ended ? 128 + SIGKILL : WIFSIGNALED(result) ? 128 + WTERMSIG(result) : WEXITSTATUS(result);
}

/* SPDX-License-Identifier: Apache-2.0 */
#define _DEFAULT_SOURCE
#define _XOPEN_SOURCE 700
#include "targets/linux/crash.h"

#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static struct {
    const char *name;
    char **words;
    const volatile int64_t *t;
} crash;

static void put(const char *text)
{
    if (write(STDERR_FILENO, text, strlen(text)) < 0) {
        return; /* there is no reader */
    }
}

/* [ns] in seconds, with all its digits. */
static void put_time(int64_t t)
{
    char text[24];
    char *at = text + sizeof text - 1;
    *at = '\0';
    for (int i = 0; i < 10 || t > 0; i++, t /= 10) {
        if (i == 9) {
            *--at = '.';
        }
        *--at = (char)('0' + t % 10);
    }
    put(at);
}

static const char *name_of(int signal_number)
{
    switch (signal_number) {
    case SIGFPE: return "division of a whole number by zero, or a floating-point trap (SIGFPE)";
    case SIGBUS: return "bus error (SIGBUS)";
    case SIGILL: return "illegal instruction (SIGILL)";
    case SIGABRT: return "abort (SIGABRT)";
    default: return "segmentation fault, or stack overflow (SIGSEGV)";
    }
}

/* The signal has its own effect again: a trap occurs once more, a sent signal is sent again. */
static void handle(int signal_number, siginfo_t *about, void *context)
{
    (void)context;
    const int64_t t = *crash.t;
    put(crash.name);
    put(": ");
    put(name_of(signal_number));
    if (t >= 0) {
        put(" in flight at t = ");
        put_time(t);
        put(" s");
    }
    put("\n");
    put(crash.name);
    put(": a debugger shows where: gdb --args");
    for (char **word = crash.words; *word != NULL; word++) {
        put(" ");
        put(*word);
    }
    put("\n");
    if (about->si_code <= 0) {
        (void)raise(signal_number);
    }
}

void crash_report(const char *name, char **words, const volatile int64_t *t)
{
    static const int signals[] = {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT};
    stack_t stack = {.ss_size = 16384}; /* that of flight may be full */
    struct sigaction action;
    crash.name = name;
    crash.words = words;
    crash.t = t;
    stack.ss_sp = mmap(NULL, stack.ss_size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (stack.ss_sp != MAP_FAILED) {
        (void)sigaltstack(&stack, NULL);
    }
    memset(&action, 0, sizeof action);
    action.sa_sigaction = handle;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK | (int)SA_RESETHAND;
    for (unsigned i = 0u; i < sizeof signals / sizeof signals[0]; i++) {
        (void)sigaction(signals[i], &action, NULL);
    }
}

/* SPDX-License-Identifier: Apache-2.0 */
#define _DEFAULT_SOURCE /* rusage has page faults only with it */
#include "targets/linux/pace.h"

#include <errno.h>
#include <sched.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>

/* Below 8 ns each bin is 1 ns wide; above, each power of two has eight bins. */
static uint32_t bin_of(int64_t ns)
{
    if (ns < 8) {
        return ns < 0 ? 0u : (uint32_t)ns;
    }
    const uint32_t octave = 63u - (uint32_t)__builtin_clzll((unsigned long long)ns);
    const uint32_t bin = 8u * (octave - 2u) + (uint32_t)(ns >> (octave - 3u) & 7);
    return bin < PACE_BINS ? bin : PACE_BINS - 1u;
}

int64_t pace_bin_end(uint32_t bin)
{
    if (bin < 8u) {
        return bin;
    }
    const uint32_t octave = bin / 8u + 2u;
    return ((INT64_C(8) + bin % 8u + 1) << (octave - 3u)) - 1;
}

void pace_note(PaceHistogram *h, int64_t ns)
{
    h->least = h->n == 0u || ns < h->least ? ns : h->least;
    h->most = h->n == 0u || ns > h->most ? ns : h->most;
    h->n++;
    h->bins[bin_of(ns)]++;
}

int64_t pace_quantile(const PaceHistogram *h, double share)
{
    const double wanted = share * (double)h->n;
    double seen = 0.0;
    for (uint32_t i = 0u; i < PACE_BINS; i++) {
        seen += h->bins[i];
        if (h->bins[i] > 0u && seen >= wanted) {
            return i + 1u < PACE_BINS && pace_bin_end(i) < h->most ? pace_bin_end(i) : h->most;
        }
    }
    return h->most;
}

static int64_t read_clock(clockid_t clock)
{
    struct timespec t = {0, 0};
    (void)clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

int64_t pace_now(void)
{
    return read_clock(CLOCK_MONOTONIC);
}

int64_t pace_date(void)
{
    return read_clock(CLOCK_REALTIME);
}

int64_t pace_cpu(void)
{
    return read_clock(CLOCK_THREAD_CPUTIME_ID);
}

int pace_sleep(int64_t until)
{
    struct timespec t;
    t.tv_sec = (time_t)(until / INT64_C(1000000000));
    t.tv_nsec = (long)(until % INT64_C(1000000000));
    return clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == 0 ? 0 : -1;
}

int pace_real_time(int priority)
{
    struct sched_param p;
    memset(&p, 0, sizeof p);
    p.sched_priority = priority;
    return sched_setscheduler(0, SCHED_FIFO, &p) == 0 ? 0 : errno;
}

int pace_lock_memory(void)
{
    return mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
}

enum { PAGE = 4096, STACK = 128 * 1024 };

extern char data_start, end; /* of static memory: the linker's */

void pace_prefault(void)
{
    volatile char stack[STACK];
    for (size_t i = 0u; i < sizeof stack; i += PAGE) {
        stack[i] = 0;
    }
    for (uintptr_t at = (uintptr_t)&data_start; at < (uintptr_t)&end; at += PAGE) {
        volatile char *byte = (volatile char *)at;
        *byte = *byte;
    }
    (void)pace_now(); /* the kernel's page with the time */
}

int64_t pace_faults(void)
{
    struct rusage used;
    (void)getrusage(RUSAGE_SELF, &used);
    return (int64_t)used.ru_minflt + used.ru_majflt;
}

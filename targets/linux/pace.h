/* SPDX-License-Identifier: Apache-2.0 */
/* The clock of the machine: wake at given times, with real-time priority and locked memory if the system permits them,
 * and measure durations. */
#ifndef TARGETS_LINUX_PACE_H
#define TARGETS_LINUX_PACE_H

#include <stdint.h>

/** A histogram of durations, each exact to an eighth of its value. It needs no heap. */
enum { PACE_BINS = 8 * 28 }; ///< up to 2^30 ns, about a second; the last bin holds longer durations too
typedef struct PaceHistogram {
    int64_t least;
    int64_t most;
    uint32_t n;
    uint32_t bins[PACE_BINS];
} PaceHistogram;

void pace_note(PaceHistogram *h, int64_t ns);

/** The duration that this share (0 to 1) of the durations does not exceed; 0 if there are none. */
int64_t pace_quantile(const PaceHistogram *h, double share);

/** The longest duration that a bin counts. */
int64_t pace_bin_end(uint32_t bin);

/** [ns] of CLOCK_MONOTONIC, of CLOCK_REALTIME, and of the processor time of this thread. */
int64_t pace_now(void);
int64_t pace_date(void);
int64_t pace_cpu(void);

/** Sleep until `until` of CLOCK_MONOTONIC. Returns 0, or -1 after a signal. */
int pace_sleep(int64_t until);

/** Request SCHED_FIFO with a priority; lock the memory. They return 0, or errno if the system refuses. */
int pace_real_time(int priority);
int pace_lock_memory(void);

/** Touch the program's static memory and the next part of its stack, so that later none of it costs a page fault. */
void pace_prefault(void);

/** Page faults of the program so far. */
int64_t pace_faults(void);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The clock of the machine: waking at given times, in real time where it is allowed, and how late. */
#ifndef TARGETS_LINUX_PACE_H
#define TARGETS_LINUX_PACE_H

#include <stdint.h>

/** A distribution of durations, to an eighth of each; without heap. */
enum { PACE_BINS = 8 * 28 }; ///< up to 2^30 ns, a second; the last one holds what is beyond
typedef struct PaceHistogram {
    int64_t least;
    int64_t most;
    uint32_t n;
    uint32_t bins[PACE_BINS];
} PaceHistogram;

void pace_note(PaceHistogram *h, int64_t ns);

/** The duration that a share of them, 0 to 1, does not exceed; 0 if there are none. */
int64_t pace_quantile(const PaceHistogram *h, double share);

/** [ns] of CLOCK_MONOTONIC, and of this thread's processor time. */
int64_t pace_now(void);
int64_t pace_cpu(void);

/** Sleep until `until` of CLOCK_MONOTONIC. 0, or -1 when a signal came. */
int pace_sleep(int64_t until);

/** Ask for SCHED_FIFO of that priority, and for memory that is never paged out. 0 if granted, else
 *  errno. */
int pace_real_time(int priority);
int pace_lock_memory(void);

#endif

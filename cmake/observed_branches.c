/* SPDX-License-Identifier: Apache-2.0 */
/* How often a run of a campaign takes each edge of flight code's branches, counted in the row of the thread that flies
 * it (sim/campaign.cpp). Of all libraries of a process the functions of the first are used, the extension, so that each
 * edge has a number of its own. */
#include <stddef.h>
#include <stdint.h>

#define SHARED __attribute__((visibility("default"), no_sanitize("coverage")))

static uint32_t n_edges;
static _Thread_local uint8_t *counts __attribute__((tls_model("initial-exec")));
static _Thread_local uint32_t n_counts __attribute__((tls_model("initial-exec")));

SHARED void __sanitizer_cov_trace_pc_guard_init(uint32_t *guard, uint32_t *end)
{
    for (; guard < end; guard++)
        if (*guard == 0)
            *guard = ++n_edges;
}

SHARED void __sanitizer_cov_trace_pc_guard(uint32_t *guard)
{
    const uint32_t edge = *guard - 1;
    if (edge < n_counts && counts[edge] < UINT8_MAX)
        counts[edge]++;
}

SHARED size_t fledge_branches(void)
{
    return n_edges;
}

/* Count in `row` of n numbers what this thread does from now on; n = 0: nowhere. */
SHARED void fledge_branches_into(uint8_t *row, size_t n)
{
    counts = row;
    n_counts = (uint32_t)n;
}

/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

#include <string.h>

CfdpRange *cfdp_ranges(const Cfdp *cfdp, const CfdpTransaction *t)
{
    return cfdp->set.ranges + (size_t)(t - cfdp->set.transactions) * cfdp->set.ranges_n + t->first;
}

uint32_t cfdp_range_at(const CfdpRange *ranges, uint32_t n, uint64_t offset)
{
    uint32_t low = 0u;
    while (low < n) {
        const uint32_t middle = low + (n - low) / 2u;
        if (ranges[middle].end > offset) {
            n = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

/* Ranges are filled from the front: that moves none. */
void cfdp_range_remove(CfdpTransaction *t, CfdpRange *ranges, uint32_t i)
{
    t->ranges--;
    if (i == 0u) {
        t->first++;
    } else {
        memmove(ranges + i, ranges + i + 1, (t->ranges - i) * sizeof *ranges);
    }
}

int cfdp_ranges_full(const Cfdp *cfdp, const CfdpTransaction *t)
{
    return t->ranges == cfdp->set.ranges_n;
}

void cfdp_range_insert(const Cfdp *cfdp, CfdpTransaction *t, uint32_t i, CfdpRange range)
{
    CfdpRange *ranges = cfdp_ranges(cfdp, t);
    if (t->first + t->ranges == cfdp->set.ranges_n) {
        memmove(ranges - t->first, ranges, t->ranges * sizeof *ranges);
        ranges -= t->first;
        t->first = 0u;
    }
    memmove(ranges + i + 1, ranges + i, (t->ranges - i) * sizeof *ranges);
    ranges[i] = range;
    t->ranges++;
}

void cfdp_range_add(const Cfdp *cfdp, CfdpTransaction *t, CfdpRange range)
{
    CfdpRange *ranges = cfdp_ranges(cfdp, t);
    const uint64_t before = range.begin == 0 ? 0 : range.begin - 1; /* a range that ends there is joined */
    const uint32_t i = cfdp_range_at(ranges, t->ranges, before);
    if (i == t->ranges || ranges[i].begin > range.end) {
        if (!cfdp_ranges_full(cfdp, t)) {
            cfdp_range_insert(cfdp, t, i, range);
        }
        return;
    }
    ranges[i].begin = range.begin < ranges[i].begin ? range.begin : ranges[i].begin;
    while (i + 1u < t->ranges && ranges[i + 1u].begin <= range.end) {
        ranges[i].end = ranges[i + 1u].end;
        cfdp_range_remove(t, ranges, i + 1u);
    }
    ranges[i].end = range.end > ranges[i].end ? range.end : ranges[i].end;
}

/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/selection: which of several messages counts. */
#ifndef FLIGHT_SELECTION_NEWEST_H
#define FLIGHT_SELECTION_NEWEST_H

#include "flight/msg/head.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

enum { NEWEST_MAX = 6 };

/** Which message was passed on last. */
typedef struct NewestMemory {
    uint32_t sequence; ///< [-] of it, as its input counts
    uint32_t passed;   ///< [-] place + 1 of its input; 0: none
} NewestMemory;

/* Whether the numbers behind a message's head are finite; all are double. */
static inline int newest_finite(const void *message, size_t size)
{
    int finite = 1;
    for (size_t at = sizeof(Head); at + sizeof(double) <= size; at += sizeof(double)) {
        double number;
        memcpy(&number, (const char *)message + at, sizeof number);
        finite &= isfinite(number) != 0;
    }
    return finite;
}

/** Pass on the newest of n <= NEWEST_MAX messages whose numbers are finite, of equally new ones the first: it keeps its
 *  time and quality, as on a wire. The output counts its own writings, one for each message that it passes on. Where
 *  none was ever written, neither is the output. in, out: messages of a size, heads first. */
static inline void pass_newest(NewestMemory *memory, int n, const void *const *in, void *out, size_t size)
{
    Head newest = {0, QUALITY_NONE, 0u}, last;
    int taken = -1;
    for (int i = 0; i < n; i++) {
        Head head;
        memcpy(&head, in[i], sizeof head);
        if (head_written(head) && (taken < 0 || head.t > newest.t) && newest_finite(in[i], size)) {
            newest = head;
            taken = i;
        }
    }
    if (taken < 0) {
        return;
    }
    memcpy(&last, out, sizeof last);
    newest.sequence = last.sequence + (memory->passed != (uint32_t)(taken + 1) || memory->sequence != newest.sequence);
    memcpy(&memory->sequence, (const char *)in[taken] + offsetof(Head, sequence), sizeof memory->sequence);
    memory->passed = (uint32_t)(taken + 1);
    memcpy(out, in[taken], size);
    memcpy(out, &newest, sizeof newest);
}

#endif

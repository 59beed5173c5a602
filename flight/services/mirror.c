/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/mirror.h"

#include <string.h>

/* Take the answer to the request that stands. */
static void take(Mirror *mirror, MemoryStore *store, const RecorderReply *reply, const RecorderRequest *request)
{
    mirror->waits = 0u;
    if (request->code == RECORDER_READ) {
        if (reply->answer == RECORDER_DONE || reply->answer == RECORDER_CORRECTED) {
            memcpy(memory_store_page(store, mirror->page), reply->data, MEMORY_PAGE);
        } else {
            mirror->damaged += reply->answer == RECORDER_DAMAGED;
        }
        mirror->page++;
    } else if (reply->answer != RECORDER_DONE) {
        mirror->worn++;
        memory_store_move(store, request->page);
    }
}

static void send(Mirror *mirror, RecorderRequest *request, RecorderCode code, uint32_t page)
{
    request->code = code;
    request->number++;
    request->page = mirror->requested = page;
    mirror->waits = 1u;
}

void mirror_update(Mirror *mirror, MemoryStore *store, const RecorderReply *reply, RecorderRequest *request, Tick t)
{
    if (head_written(reply->head) == 0 || reply->pages == 0u) { /* it is not there, or has no power */
        request->head = head_held(request->head);
        return;
    }
    if (request->code == RECORDER_NOTHING) {
        request->number = reply->number + 1u; /* that may be a request of before this start, and under way */
        if (mirror->waits != 0u && store->mounted != 0u) {
            memory_store_mark(store, mirror->requested, 1); /* flight was reset, and its memory stayed */
        }
        mirror->waits = 0u;
    } else if (mirror->waits != 0u && reply->number == request->number) {
        take(mirror, store, reply, request);
    }
    const uint32_t kept = reply->pages < store->pages ? reply->pages : store->pages;
    const uint32_t used = reply->used < kept ? reply->used : kept;
    if (mirror->waits == 0u && store->mounted == 0u && mirror->page < used) {
        send(mirror, request, RECORDER_READ, mirror->page);
        mirror->left = used - mirror->page;
    } else if (mirror->waits == 0u) {
        if (store->mounted == 0u) {
            store->pages = kept;
            memory_store_mount(store);
        }
        uint32_t n;
        const int32_t dirty = memory_store_dirty(store, &n);
        if (dirty >= 0) {
            send(mirror, request, RECORDER_WRITE, (uint32_t)dirty);
            memcpy(request->data, memory_store_page(store, (uint32_t)dirty), MEMORY_PAGE);
            memory_store_mark(store, (uint32_t)dirty, 0);
        }
        mirror->left = n;
    }
    request->head = head_next(request->head, t.t, QUALITY_GOOD);
}

/* SPDX-License-Identifier: Apache-2.0 */
/* A store of files in one block of plain memory, without pointers: a block that is copied is the same store.
 *
 * The store is pages of 256 bytes. Each has its checksum; the entry of a file, in a page of its own, has the sum of its
 * pages' checksums. So a copy that was made page by page, while files changed, or that was damaged later, mounts with
 * those files that are whole: a file is as it was written, or is dropped and counted.
 *
 * memory_store_dirty() says which page is to be copied next. In its order a rename takes effect at once: the
 * copy has the old file or the new one. Numbers in pages are big-endian, so pages are the same on each computer.
 *
 * Example:
 *
 *     static uint64_t memory[MEMORY_STORE_BYTES(64) / 8];
 *     MemoryStore *const store = (MemoryStore *)memory;
 *     memory_store_begin(store, sizeof memory); // empty pages
 *     memory_store_mount(store); // after the pages were filled with those of an old store
 *     const CfdpStore files = memory_store_files(store);
 */
#ifndef CCSDS_STORE_MEMORY_STORE_H
#define CCSDS_STORE_MEMORY_STORE_H

#include "ccsds/cfdp.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    MEMORY_PAGE = 256, ///< [bytes]
    MEMORY_DATA = 244, ///< [bytes] of a file in a page
    MEMORY_PAGES_MAX = 65536
};

/** The head of the block; its pages follow. */
typedef struct MemoryStore {
    uint32_t pages;   ///< how many; it may be lowered before a mount
    uint32_t free;    ///< pages that are free
    uint32_t serial;  ///< of the next file or change of a name
    uint32_t turn;    ///< the page that is taken next, if it is free, so that all wear equally
    uint32_t mounted; ///< 0: all functions of the store give CFDP_BROKEN
    uint32_t lost;    ///< files that the last mount dropped
} MemoryStore;

/** [bytes] of a block with n pages. */
#define MEMORY_STORE_BYTES(n) (sizeof(MemoryStore) + ((n) * (MEMORY_PAGE + 1u) + 7u) / 8u * 8u)

/** A block of `bytes`, at least MEMORY_STORE_BYTES(1), with as many pages as it has room for. They are empty, and the
 * store is not mounted. */
void memory_store_begin(MemoryStore *store, size_t bytes);

uint8_t *memory_store_page(MemoryStore *store, uint32_t page);

/** Find the files in the pages. Damaged ones, and those that pages of different times make up, are dropped and counted
 * in `lost`; a directory whose entry is damaged is made anew. */
void memory_store_mount(MemoryStore *store);

/** The page that is to be copied next, or -1. *n: how many are to be copied. */
int32_t memory_store_dirty(const MemoryStore *store, uint32_t *n);

/** The page was copied, or has to be copied again (dirty = 1). */
void memory_store_mark(MemoryStore *store, uint32_t page, int dirty);

/** The page's copy is worn out: move its content elsewhere, and do not use it again before the next
 * memory_store_begin(). Returns 0 if no page is free for that: the content stays without a copy. */
int memory_store_move(MemoryStore *store, uint32_t page);

/** The functions of the store. A handle of a file that was removed or replaced gives CFDP_BROKEN, a page that was
 * damaged in memory too. Directories are not renamed. */
CfdpStore memory_store_files(MemoryStore *store);

#ifdef __cplusplus
}
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The only heap of the interpreter: a range of static memory, zeroed when taken, with a high-water mark and a lock. It
 * reuses freed blocks, so that the compiler and resized lists leave no holes for ever; there is no garbage
 * collector. Under the lock every request fails: the loop of flight does not allocate. A block that is freed under
 * the lock, or of a procedure, keeps its content until the end: the interpreter may still read it, for example a list
 * whose elements change it while it is sorted. */
#ifndef TARGETS_MICROPYTHON_ARENA_H
#define TARGETS_MICROPYTHON_ARENA_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct Arena {
    uint8_t *memory;
    size_t size;   ///< [bytes]
    size_t used;   ///< [bytes] now, with the arena's own
    size_t peak;   ///< [bytes] the most so far
    int locked;    ///< 1: requests fail
    int keeps;     ///< 1: freed blocks are not used again; so it is under the lock
    size_t wanted; ///< [bytes] of the last request that failed
} Arena;

/** The arena that the interpreter uses now: that of flight, or that of a procedure. */
extern Arena *arena_in_use;

/** Begin anew, empty. memory: aligned to 8 bytes. */
void arena_begin(Arena *arena, void *memory, size_t size);

/** malloc, realloc and free of the arena in use. A block that grows keeps its place if it can. */
void *arena_take(size_t n);
void *arena_resize(void *block, size_t n);
void arena_give(void *block);

#ifdef __cplusplus
}
#endif

#endif

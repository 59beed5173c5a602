/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/micropython/arena.h"

#include <string.h>

/* Blocks lie one behind the other, free ones too: two free ones never touch. Offsets lead to the neighbours. */
typedef struct Block {
    uint32_t size;   /* [bytes] with this head; the lowest bit: in use */
    uint32_t before; /* [bytes] of the block before; 0: there is none */
} Block;

enum { IN_USE = 1, STEP = 8 };

Arena *arena_in_use;

static uint32_t size_of(const Block *b)
{
    return b->size & ~(uint32_t)IN_USE;
}

static Block *first(const Arena *arena)
{
    return (Block *)(void *)arena->memory;
}

/* NULL behind the last. */
static Block *next(const Arena *arena, Block *b)
{
    uint8_t *at = (uint8_t *)b + size_of(b);
    return at < arena->memory + arena->size ? (Block *)(void *)at : NULL;
}

/* Write the size of a block, also into its neighbour. */
static void set_size(const Arena *arena, Block *b, uint32_t size, uint32_t in_use)
{
    b->size = size | in_use;
    Block *behind = next(arena, b);
    if (behind) {
        behind->before = size;
    }
}

/* Cut a block to size; the rest becomes free, joined with a free neighbour behind it. */
static void cut(const Arena *arena, Block *b, uint32_t size)
{
    const uint32_t left = size_of(b) - size;
    if (left == 0u) {
        return;
    }
    set_size(arena, b, size, b->size & IN_USE);
    Block *rest = (Block *)(void *)((uint8_t *)b + size);
    set_size(arena, rest, left, 0u);
    rest->before = size;
    Block *behind = next(arena, rest);
    if (behind && !(behind->size & IN_USE)) {
        set_size(arena, rest, left + behind->size, 0u);
    }
}

/* The size of a block for n bytes; 0: none can be so large. */
static uint32_t needed(const Arena *arena, size_t n)
{
    return n <= arena->size ? (uint32_t)((n + sizeof(Block) + STEP - 1u) & ~(size_t)(STEP - 1)) : 0u;
}

static void count(Arena *arena, uint32_t before, uint32_t after)
{
    arena->used = arena->used - before + after;
    if (arena->used > arena->peak) {
        arena->peak = arena->used;
    }
}

void arena_begin(Arena *arena, void *memory, size_t size)
{
    memset(arena, 0, sizeof *arena);
    arena->memory = memory;
    arena->size = size < UINT32_MAX ? size & ~(size_t)(STEP - 1) : UINT32_MAX & ~(uint32_t)(STEP - 1);
    first(arena)->before = 0u;
    first(arena)->size = (uint32_t)arena->size;
}

void *arena_take(size_t n)
{
    Arena *arena = arena_in_use;
    const uint32_t size = needed(arena, n);
    for (Block *b = size != 0u && !arena->locked ? first(arena) : NULL; b; b = next(arena, b)) {
        if (!(b->size & IN_USE) && b->size >= size) {
            b->size |= IN_USE;
            cut(arena, b, size);
            count(arena, 0u, size);
            return memset(b + 1, 0, size - sizeof *b);
        }
    }
    arena->wanted = n;
    return NULL;
}

void arena_give(void *block)
{
    Arena *arena = arena_in_use;
    if (!block || arena->keeps || arena->locked) {
        return;
    }
    Block *b = (Block *)block - 1;
    count(arena, size_of(b), 0u);
    b->size = size_of(b);
    Block *before = b->before != 0u ? (Block *)(void *)((uint8_t *)b - b->before) : NULL;
    if (before && !(before->size & IN_USE)) {
        set_size(arena, before, before->size + b->size, 0u);
        b = before;
    }
    Block *behind = next(arena, b);
    if (behind && !(behind->size & IN_USE)) {
        set_size(arena, b, b->size + behind->size, 0u);
    }
}

void *arena_resize(void *block, size_t n)
{
    if (!block) {
        return arena_take(n);
    }
    Arena *arena = arena_in_use;
    Block *b = (Block *)block - 1;
    const uint32_t old = size_of(b), size = needed(arena, n);
    if (size == 0u || (size > old && arena->locked)) {
        arena->wanted = n;
        return NULL;
    }
    if (size <= old && (arena->keeps || arena->locked)) {
        return block;
    }
    if (size <= old) {
        cut(arena, b, size);
        count(arena, old, size);
        return block;
    }
    Block *behind = next(arena, b);
    if (behind && !(behind->size & IN_USE) && old + behind->size >= size) {
        set_size(arena, b, old + behind->size, IN_USE);
        cut(arena, b, size);
        count(arena, old, size);
        memset((uint8_t *)b + old, 0, size - old);
        return block;
    }
    void *moved = arena_take(n);
    if (moved) {
        memcpy(moved, block, old - sizeof *b);
        arena_give(block);
    }
    return moved;
}

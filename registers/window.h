/* SPDX-License-Identifier: Apache-2.0 */
/* A board's memory as one side sees it: 32-bit words in the board's byte order.
 *
 * Every access is one volatile, atomic load or store of an aligned word. So no word is torn, and a
 * reader that sees a word also sees all words stored before it. The memory needs no read-modify-write
 * and no side effect of a load or a store: plain RAM is enough, of this process, of two processes or
 * of an emulated board, and so is a 32-bit processor without compare-and-swap. */
#ifndef REGISTERS_WINDOW_H
#define REGISTERS_WINDOW_H

#include "registers/board.h"

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct RegisterWindow {
    const RegisterBoard *board;
    volatile uint32_t *words; ///< aligned to 8 bytes, board->size bytes
    uint32_t swap;            ///< 1: the board's byte order is not this processor's
    /** Called for each interrupt that this side raises, after it was counted; may be NULL. */
    void (*ring)(void *user, uint32_t line);
    void *user;
} RegisterWindow;

/** The window of a board onto memory that holds it; no ring. */
static inline RegisterWindow register_window(const RegisterBoard *board, volatile uint32_t *words)
{
    RegisterWindow w;
    w.board = board;
    w.words = words;
    w.swap = (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__) != (board->big_endian != 0u);
    w.ring = NULL;
    w.user = NULL;
    return w;
}

/** A control word: all accesses to control words, of both sides, have one order. */
static inline uint32_t register_load(const RegisterWindow *w, uint32_t address)
{
    const uint32_t v = __atomic_load_n(&w->words[address / 4u], __ATOMIC_SEQ_CST);
    return w->swap ? __builtin_bswap32(v) : v;
}

static inline void register_store(const RegisterWindow *w, uint32_t address, uint32_t value)
{
    const uint32_t v = w->swap ? __builtin_bswap32(value) : value;
    __atomic_store_n(&w->words[address / 4u], v, __ATOMIC_SEQ_CST);
}

/** Four bytes of payload as they lie in memory. A reader of a new value also sees all that was stored before it, so a
 *  reader that was overtaken notices that. */
static inline uint32_t register_load_bytes(const RegisterWindow *w, uint32_t address)
{
    return __atomic_load_n(&w->words[address / 4u], __ATOMIC_ACQUIRE);
}

static inline void register_store_bytes(const RegisterWindow *w, uint32_t address, uint32_t v)
{
    __atomic_store_n(&w->words[address / 4u], v, __ATOMIC_RELEASE);
}

#ifdef __cplusplus
}
#endif

#endif

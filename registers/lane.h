/* SPDX-License-Identifier: Apache-2.0 */
/* Writing and reading through a lane: the same code on both sides. One writer and one reader per
 * lane; neither waits for the other, and every call ends in bounded time.
 *
 *   word           a plain register: reads as last written
 *   packet         the last one whole, by Simpson's four slots (IEE Proc. E 137(1), 1990): the
 *                  writer always finds a slot that the reader does not look at
 *   queued         a ring of slots. Full: the newest is refused, or the oldest dropped; both are
 *                  counted, and both leave a gap in the sequence
 *
 * A control block, 32 bytes, is in front of the slots of all but plain words.
 *
 * Example:
 *
 *     static void flight_end(const RegisterBoard *board, volatile uint32_t *memory, const float command[4])
 *     {
 *         const RegisterWindow w = register_window(board, memory);
 *         register_put(&w, &board->lanes[0], command, 16, 0);
 *         float speeds[4];
 *         RegisterInfo info;
 *         if (register_take(&w, &board->lanes[1], speeds, sizeof speeds, &info) == REGISTER_OK) {
 *             // new ones, number info.sequence
 *         }
 *     }
 */
#ifndef REGISTERS_LANE_H
#define REGISTERS_LANE_H

#include "registers/window.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum RegisterStatus {
    REGISTER_OK = 0,
    REGISTER_SAME,   ///< read, but it is the packet of the last call
    REGISTER_EMPTY,  ///< there is no packet to read
    REGISTER_FULL,   ///< the queue refused the packet, and counted it as lost
    REGISTER_SIZE,   ///< wrong size of the packet or of the reader's buffer; nothing was done
    REGISTER_BUSY,   ///< the writer overtook every attempt to read; the lane counts the packets as lost
    REGISTER_CORRUPT ///< the memory holds invalid bytes; a queue skips the packet and counts it
} RegisterStatus;

/** The properties of a packet. */
typedef struct RegisterInfo {
    uint32_t n;        ///< [bytes]
    uint32_t tag;      ///< from its descriptor; 0 if there is none
    uint32_t sequence; ///< numbers the writes from 1, without those that a queue refused
} RegisterInfo;

/** The control block: addresses in bytes from its start, the side that stores there, and the meaning. */
enum {
    REGISTER_WRITTEN = 0,       ///< writer: number of writes
    REGISTER_TAKEN = 4,         ///< reader: number of packets taken; not queued: the last sequence number
    REGISTER_LOST_WRITING = 8,  ///< writer: number of refused packets
    REGISTER_LOST_READING = 12, ///< reader: number of packets overwritten before it read them
    REGISTER_BEGUN = 16,        ///< writer, overwriting queue: number of writes begun
    REGISTER_LATEST = 16,       ///< writer, not queued: the pair of slots written last
    REGISTER_SLOTS = 20,        ///< writer, not queued: of each pair the slot written last
    REGISTER_READING = 28,      ///< reader, not queued: the pair that it reads
    REGISTER_CONTROL_SIZE = 32,
    REGISTER_SLOT_HEAD = 8 ///< of a packet's slot: its describing word, its sequence
};

/** Write n bytes as a packet. The lane is a packet or message. */
RegisterStatus register_put(const RegisterWindow *w, const RegisterLane *lane, const void *bytes, uint32_t n,
                            uint32_t tag);

/** The same for two pieces, one behind the other. n_head is a multiple of 4. */
RegisterStatus register_put_two(const RegisterWindow *w, const RegisterLane *lane, const void *head, uint32_t n_head,
                                const void *bytes, uint32_t n, uint32_t tag);

/** Read a packet into `room` bytes. With REGISTER_SIZE, info->n is the room it needs. */
RegisterStatus register_take(const RegisterWindow *w, const RegisterLane *lane, void *bytes, uint32_t room,
                             RegisterInfo *info);

/** The same into two pieces. A packet shorter than n_head bytes leaves the rest as it was. */
RegisterStatus register_take_two(const RegisterWindow *w, const RegisterLane *lane, void *head, uint32_t n_head,
                                 void *bytes, uint32_t room, RegisterInfo *info);

/** Write a word: the one of this index of a plain lane, or at the end of a queue (index 0). */
RegisterStatus register_put_word(const RegisterWindow *w, const RegisterLane *lane, uint32_t index, uint32_t value);

/** Read a word: the one of this index of a plain lane, or from the front of a queue (index 0). */
RegisterStatus register_take_word(const RegisterWindow *w, const RegisterLane *lane, uint32_t index, uint32_t *value);

/** The tag of the packet that the next register_take of a queue reads; REGISTER_EMPTY: there is none. */
RegisterStatus register_next_tag(const RegisterWindow *w, const RegisterLane *lane, uint32_t *tag);

/** How many are there to be read. Not queued: 1 if there is one not yet read. Plain words: 0. */
uint32_t register_waiting(const RegisterWindow *w, const RegisterLane *lane);

/** How many were lost so far, refused or dropped. Always 0 where nothing is queued. */
uint32_t register_lost(const RegisterWindow *w, const RegisterLane *lane);

/** Interrupts are counted, so a late reader loses none. A line has one side that
 *  raises it, and one that handles it. */
void register_raise(const RegisterWindow *w, uint32_t line);

/** How often a line was raised and not yet handled. */
uint32_t register_interrupts(const RegisterWindow *w, uint32_t line);

/** The same, and takes them all as handled. */
uint32_t register_handle(const RegisterWindow *w, uint32_t line);

#ifdef __cplusplus
}
#endif

#endif

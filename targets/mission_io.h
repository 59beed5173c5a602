/* SPDX-License-Identifier: Apache-2.0 */
/* Transfers the messages of an exported mission through the lanes of its boards. `fledge export` writes the table of
 * the transfers from the mission and the files of the boards. Both sides use the same table: flight for the whole
 * mission at once, the outside for one message at a time.
 *
 * A message lane carries a whole message. A lane of words carries numbers of a message in the fields of its words: word
 * i holds the i-th number. The lane does not carry the head of such a message, so the reader writes a new one at each
 * reading, with the present time and quality GOOD; fields of the head that a lane carries replace these values. A
 * number that no lane carries does not change.
 *
 * A packet carries numbers of one message in fields of its own, at their places in bytes. So does a queued word. The
 * reader writes the head when a packet arrives; without a new one, the message stays as it is, and ages. Of a queue a
 * reader sees one packet of each kind at each reading: the oldest that it has not seen, and packets behind it wait; or
 * the newest, and then it counts those that it skips.
 *
 * Two queues carry packets: commands to flight, and telemetry from it.
 *
 * Time comes from the clock of the first board that has one. A tick with t < 0 resets flight, which then writes all
 * outputs; no module runs. Each later tick is one exchange: mission_io_read, the mission's tick, mission_io_write,
 * register_clock_finish. */
#ifndef TARGETS_MISSION_IO_H
#define TARGETS_MISSION_IO_H

#include "flight/exec/element.h"
#include "registers/clock.h"
#include "registers/message.h"
#include "targets/mission.h"

#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A message in a message lane, or some of its numbers in a field of a lane of words or packets. */
typedef struct MissionLane {
    const RegisterMessage *type; ///< of a message lane; NULL: a lane of words
    uint16_t message;            ///< its id
    uint16_t board;              ///< the index of the board
    uint16_t lane;               ///< the index of the lane in the board
    uint16_t field;              ///< the index of the field in the words or packets
    uint32_t offset;             ///< [bytes] of the first number in the message
    FledgeType number;
} MissionLane;

/** A queue of packets. */
typedef struct MissionQueue {
    uint16_t board; ///< the index of the board; MISSION_NO_BOARD: there is no such queue
    uint16_t lane;  ///< the index of the lane in the board
} MissionQueue;

enum { MISSION_NO_BOARD = 0xFFFF, MISSION_BOARDS_MAX = 4 /* of the hosts */ };

typedef struct MissionIo MissionIo;
typedef struct MissionIoCounts MissionIoCounts;

/** A kind of packets in a lane, by its tag; or a queued word, as a packet of 4 bytes. */
typedef struct MissionPacket {
    uint16_t board;  ///< the index of the board
    uint16_t lane;   ///< the index of the lane in the board
    uint32_t size;   ///< [bytes] to the end of the last number; of packets of fixed size: theirs
    uint8_t tag;     ///< from the descriptor; 0 without one
    uint8_t newest;  ///< of a queue, 1: the reader sees the newest packet; 0: the oldest
    uint8_t *memory; ///< size + 1 bytes: the last packet, then 1 until the reader has seen it
} MissionPacket;

/** How packets pass (mission_packets.h). `put` and `take` begin with the i-th row, and return the first row that is not
 *  of its packet and message; they return i if the row is not of a packet. */
typedef struct MissionPacketFunctions {
    uint32_t (*put)(const MissionIo *io, const RegisterWindow *w, uint32_t i, const uint8_t *message,
                    MissionIoCounts *counts);
    /** *headed: whether the message has got its head. */
    uint32_t (*take)(const MissionIo *io, const RegisterWindow *w, uint32_t i, uint8_t *message, int64_t t, int *headed,
                     MissionIoCounts *counts);
    void (*forget)(const MissionIo *io, const RegisterWindow *w);
    uint32_t (*lost)(const MissionIo *io, const RegisterWindow *w);
} MissionPacketFunctions;

/** The kinds of packets of a mission. */
typedef struct MissionPackets {
    const MissionPacketFunctions *functions;
    const MissionPacket *kinds; ///< those of one lane are adjacent
    uint32_t n;
    uint8_t *scratch; ///< memory for the longest packet of these lanes
} MissionPackets;

/** The table of a mission. The lanes of one message are adjacent. */
struct MissionIo {
    const MissionMessage *messages;
    const RegisterBoard *const *boards;
    const MissionLane *lanes;
    uint32_t n_messages;
    uint32_t n_boards;
    uint32_t n_lanes;
    const MissionPackets *packets; ///< the kinds of packets with numbers; NULL: none
    MissionQueue commands;
    MissionQueue telemetry;
    uint8_t *packet; ///< memory for the longest command that can come
    uint32_t room;   ///< [bytes] of it
};

/** Counters of faults. */
struct MissionIoCounts {
    uint32_t refused;   ///< messages not written: the queue was full, or the size is wrong
    uint32_t corrupt;   ///< messages with invalid bytes; the reader sees a message that was never written
    uint32_t saturated; ///< numbers limited to the range of their field
    uint32_t skipped;   ///< packets replaced by a newer one before they were seen
};

/** The index of the board whose clock paces flight; n_boards if no board has a clock. */
uint32_t mission_io_clock(const MissionIo *io);

/** Flight: read all lanes at t into the mission, which handles their interrupts. `w` has a window for each board. */
void mission_io_read(const MissionIo *io, const RegisterWindow *w, void *mission, int64_t t, MissionIoCounts *counts);

/** Flight, at a reset: forget the packets that wait to be read; w NULL: those that it holds, while the lanes stay. */
void mission_io_forget(const MissionIo *io, const RegisterWindow *w);

/** The memory of a program about its start; all zero after power-on. */
typedef struct MissionStart {
    uint32_t begun;  ///< 1: flight has begun
    uint32_t resets; ///< of the computer, as the clock counts them, then
} MissionStart;

/** Flight: whether the computer was reset since the last call, or this is the first one. Then the packets that it
 *  holds are forgotten. */
int mission_io_restarted(const MissionIo *io, const RegisterWindow *w, MissionStart *start);

/** How many packets of messages were lost in the lanes so far: refused, or overwritten before they were read. */
uint32_t mission_io_lost(const MissionIo *io, const RegisterWindow *w);

/** Flight: write all outputs that a lane carries. */
void mission_io_write(const MissionIo *io, const RegisterWindow *w, const void *mission, MissionIoCounts *counts);

/** Take the next packet of a queue; returns its size [bytes], 0 if there is none. */
uint32_t mission_io_receive(const MissionIo *io, const RegisterWindow *w, MissionQueue queue, void *packet,
                            uint32_t room, MissionIoCounts *counts);

/** Put a packet into a queue, if there is one. Returns 1 if it was put. */
int mission_io_send(const MissionIo *io, const RegisterWindow *w, MissionQueue queue, const void *packet, uint32_t n,
                    MissionIoCounts *counts);

/** Outside: write a message to flight, by its id. */
void mission_io_put(const MissionIo *io, const RegisterWindow *w, uint32_t id, const void *message,
                    MissionIoCounts *counts);

/** Outside: read a message of flight, by its id, at t. Numbers that no lane carries do not change. */
void mission_io_take(const MissionIo *io, const RegisterWindow *w, uint32_t id, void *message, int64_t t,
                     MissionIoCounts *counts);

/** Write the head of a message that passes in words or packets. Rows of head fields replace these values afterwards. */
static inline void mission_io_head(uint8_t *message, int64_t t)
{
    Head head;
    memcpy(&head, message, sizeof head);
    head = head_next(head, t, QUALITY_GOOD);
    memcpy(message, &head, sizeof head);
}

/** Whether a lane carries a part of this message. */
int mission_io_carries(const MissionIo *io, uint32_t id);

#ifdef __cplusplus
}
#endif

#endif

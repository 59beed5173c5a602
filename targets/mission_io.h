/* SPDX-License-Identifier: Apache-2.0 */
/* How the messages of an exported mission pass the lanes of its boards: a table, generated from the
 * mission and the boards' files, and the code that follows it. Both sides use the same table: flight
 * for all of a mission at once, the outside for one message at a time.
 *
 * A message passes whole, through a message lane, or in parts, as numbers in the fields of words:
 * word i of a lane holds the i-th number. Of such a message the reader has no head; unless parts of
 * it are carried too, it is written anew at each reading, now, and good. A number that no word
 * carries stays as it was.
 *
 * A block of parameters passes whole, through a message lane, from the ground: it counts from the
 * tick on in which it is there, once. Modules that publish their parameters cannot be changed this way.
 *
 * Time comes with the clock of the first board that has one. A tick before time 0 asks flight to
 * begin: it is reset, and shows all that it puts out, and nothing runs. Each tick from then on is one
 * exchange: mission_io_read, the mission's tick, mission_io_write, register_clock_finish. */
#ifndef TARGETS_MISSION_IO_H
#define TARGETS_MISSION_IO_H

#include "flight/exec/element.h"
#include "registers/clock.h"
#include "registers/message.h"
#include "targets/mission.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A message in a lane, or some of its numbers in a field of a lane of words. */
typedef struct MissionLane {
    const RegisterMessage *type; ///< of a message lane; NULL: words
    uint16_t message;            ///< its id; of n_messages + k: the k-th block of parameters
    uint16_t board;              ///< its place among the boards
    uint16_t lane;               ///< its place among the board's lanes
    uint16_t field;              ///< of the words
    uint32_t offset;             ///< [bytes] of the first number in the message
    FledgeType number;
} MissionLane;

/** All of a mission. The lanes of one message follow one another. */
typedef struct MissionIo {
    const MissionMessage *messages;
    const RegisterBoard *const *boards;
    const MissionLane *lanes;
    uint32_t n_messages;
    uint32_t n_boards;
    uint32_t n_lanes;
    uint32_t n_parameters;               ///< 0: no lane carries any
    const MissionParameters *parameters; ///< NULL: none
    void *block;                         ///< room for the largest block that a lane carries
} MissionIo;

/** What has gone wrong, counted. All zero: nothing. */
typedef struct MissionIoCounts {
    uint32_t refused;   ///< not written: a queue was full, or the lane is for another size
    uint32_t corrupt;   ///< no writer writes such bytes; the message counts as never written
    uint32_t saturated; ///< limited to a field's range
} MissionIoCounts;

/** The place of the clock that paces flight; n_boards if no board has one. */
uint32_t mission_io_clock(const MissionIo *io);

/** Flight: read all lanes at t into the mission. `w` has a window for each board. */
void mission_io_read(const MissionIo *io, const RegisterWindow *w, void *mission, int64_t t, MissionIoCounts *counts);

/** Flight: put all that the lanes carry out of the mission. */
void mission_io_write(const MissionIo *io, const RegisterWindow *w, const void *mission, MissionIoCounts *counts);

/** Outside: put a message, by its id. */
void mission_io_put(const MissionIo *io, const RegisterWindow *w, uint32_t id, const void *message,
                    MissionIoCounts *counts);

/** Outside: take a message, by its id, at t. What the lanes do not hold stays as it is. */
void mission_io_take(const MissionIo *io, const RegisterWindow *w, uint32_t id, void *message, int64_t t,
                     MissionIoCounts *counts);

/** Whether a lane carries any of a message. */
int mission_io_carries(const MissionIo *io, uint32_t id);

#ifdef __cplusplus
}
#endif

#endif

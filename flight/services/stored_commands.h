/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_STORED_COMMANDS_H
#define FLIGHT_SERVICES_STORED_COMMANDS_H

#include "flight/command/command.h"
#include "flight/msg/avionics.h"
#include "flight/msg/event.h"
#include "flight/msg/services.h"

enum { STORED_COMMANDS = 24, STORED_LISTS = 16 };
enum { STORED_RUNS = 1, STORED_HELD = 2 }; ///< of a list
enum { STORED_PATIENCE = 10 };

/** Its events. */
typedef enum StoredCommandsEventId {
    STORED_COMMANDS_STARTED = 1,   ///< info, list [-]: a sequence was started
    STORED_COMMANDS_ENDED = 2,     ///< info, list [-]: nothing is left of a sequence, or a command stopped it
    STORED_COMMANDS_LATE = 3,      ///< medium, list [-], step [-], late [s]: a command was skipped, as it was too late
    STORED_COMMANDS_INHIBITED = 4, ///< low, list [-], step [-]: a command was skipped, as its list is inhibited
    STORED_COMMANDS_DAMAGED = 5,   ///< high, list [-], step [-]: a command was skipped, as its checksum does not hold
    STORED_COMMANDS_OVER = 6 ///< info, n [-]: commands of list 0 left the store, as they were over before the reset
} StoredCommandsEventId;

/** A command that waits for its time. */
typedef struct StoredCommand {
    int64_t time;                       ///< [ns] >= 0: on list 0 of the clock; of a sequence since its start
    uint16_t list;                      ///< [-] in [0, 15]: the list that it is of
    uint16_t step;                      ///< [-] no other command of its list has it
    uint16_t size;                      ///< [-] in [0, 112]: bytes of the packet; 0: this place is free
    uint16_t crc;                       ///< [-] of list, step, time and packet, as in the command that stores it
    uint8_t packet[COMMAND_STORED_MAX]; ///< [-] the command, header included
} StoredCommand;

/** How far a list is. */
typedef struct StoredList {
    int64_t begun;  ///< [ns] when the sequence was started, later by as long as it was held
    int64_t held;   ///< [ns] since when it is held
    int64_t time;   ///< [ns] since the start: what comes before this time and step is over
    uint32_t step;  ///< [-] of that time
    uint32_t state; ///< [-] STORED_RUNS, STORED_HELD
} StoredList;

/** A place in the order of list 0. */
typedef struct StoredPlace {
    int64_t time; ///< [ns]
    int64_t step; ///< [-] of that time
} StoredPlace;

/** Commands that are stored on board and executed at their times: list 0 has those of absolute times, each of the lists
 *  1 to 15 a sequence (a block of commands), whose times count from its start. The commands 15 to 18 store and delete
 *  them, control the lists and report what is stored.
 *
 *  At each instant flight first executes the commands of the ground, then those stored ones that are due: the one that
 *  was due first, of equal times that of the lowest list, then of the lowest step; 4 at most, the others follow at the
 *  next instants. Each passes the checks of a command from the ground when it is executed, and is reported as one, with
 *  its list. One that is refused does not end its sequence. Two lists that ask for different modes at one time are a
 *  conflict: the command that would store the second one, or start its sequence, is refused.
 *
 *  A command of list 0 leaves the store before it is executed, so that none is executed twice: where the clock jumps
 *  back, those that are left wait for it. Where it jumps forward, all that are due follow one another, but those later
 *  than `late`, which are skipped and reported. Sequences count flight's own time, which does not jump.
 *
 *  The store is a parameter: it stays over a reset of flight, at which all sequences stop. What came due meanwhile is
 *  late. After a reset of the computer it is as it was built, or as a table in boot/ of Files has it. No mode may
 *  suspend the module's task.
 *
 *  Such a table has all commands again. With a slot of the non-volatile memory no command of list 0 is executed twice
 *  all the same: before one is executed, the memory has its time and step, and what comes before them is over, and
 *  leaves the store, whatever brings it back. What came due while the computer was down is executed, if not too late.
 *  So a command of list 0 is executed some updates after its time, when the memory has answered; where it does not
 *  answer for 10 updates, without it. What the ground stores by command at an earlier time than that is not over. */
typedef struct StoredCommands {
    struct {
        VehicleTimeState clock; ///< optional: the clock of list 0
        NvmPacket reply;        ///< optional: of the non-volatile memory
    } in;
    struct {
        StoredState state;
        FlightEvent event;
        NvmPacket request;
    } out;
    struct {
        StoredCommand commands[STORED_COMMANDS]; ///< the store, in any order
        double late;      ///< [s] >= 0: a command that is later than this is skipped; 0: none is too late
        uint32_t clocked; ///< [-] in [0, 1]: 1: list 0 waits for the clock and follows it; 0: it follows flight's time
        uint32_t inhibited; ///< [-] bit i: what comes due on list i is not executed
        uint32_t slot;      ///< [-] place + 1 in the non-volatile memory; 0: none
        uint32_t spare;
    } par;
    struct {
        StoredList lists[STORED_LISTS];
        int64_t ahead;     ///< [ns] of the clock over flight's time
        uint32_t known;    ///< [-] 1: that is known
        uint32_t released; ///< [-] of the state
        uint32_t skipped;  ///< [-] of the state
        uint32_t waited;   ///< [-] updates since the memory answered, up to 10
        uint32_t restored; ///< [-] 1: it has been read since the computer began
        uint32_t spare;
        StoredPlace over;   ///< what comes before it on list 0 is over
        StoredPlace kept;   ///< what the memory has of that, or of what may be executed now
        StoredPlace wanted; ///< what it shall have
    } mem;
} StoredCommands;

void stored_commands_reset(StoredCommands *m);
void stored_commands_update(StoredCommands *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService stored_commands_service;

#endif

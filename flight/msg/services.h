/* SPDX-License-Identifier: Apache-2.0 */
/* What flight services say of themselves. */
#ifndef FLIGHT_MSG_SERVICES_H
#define FLIGHT_MSG_SERVICES_H

#include "flight/msg/head.h"

/** The commands that wait on board. Bit i of a set is that of list i. */
typedef struct StoredState {
    Head head;
    int64_t next;       ///< [ns] of flight: when the next command is due, as things stand; -1: none is
    uint32_t running;   ///< [-] sequences that run
    uint32_t held;      ///< [-] lists that are held
    uint32_t inhibited; ///< [-] lists whose commands are not executed
    uint32_t stored;    ///< [-] commands in the store
    uint32_t released;  ///< [-] commands that were given to flight since the reset
    uint32_t skipped;   ///< [-] commands that were not: too late, inhibited or damaged
} StoredState;

/** The monitors of outputs. Bit i of a set is that of monitor i. */
typedef struct MonitorState {
    Head head;
    uint32_t on;    ///< [-] those that check
    uint32_t wrong; ///< [-] those whose last check was wrong
    uint32_t held;  ///< [-] those that have fired, and whose check was not right since
    uint32_t bad;   ///< [-] those that name no number of an output
    uint32_t fired; ///< [-] how often monitors fired since the reset
    uint32_t spare;
} MonitorState;

/** The log of events. */
typedef struct EventLogState {
    Head head;
    uint32_t kept;       ///< [-] events in it
    uint32_t logged;     ///< [-] events that it ever had
    uint32_t below;      ///< [-] events since the reset that were not grave enough
    uint32_t suppressed; ///< [-] events since the reset that were too many in a time
    uint32_t replaced;   ///< [-] events since the reset that others replaced in their output before they were seen
    uint32_t unseen;     ///< [-] outputs of events that it does not see, for there are too many
} EventLogState;

/** The reports of chosen numbers. Bit i of a set is that of report i. */
typedef struct HousekeepingState {
    Head head;
    uint32_t on;   ///< [-] those that are sent
    uint32_t bad;  ///< [-] those whose last packet left out a choice
    uint32_t sent; ///< [-] packets since the reset
    uint32_t spare;
} HousekeepingState;

/** Files on board, and the protocol that carries them. Counters are since the computer began. */
typedef struct FilesState {
    Head head;
    uint32_t receiving; ///< [-] transactions that bring a file or messages
    uint32_t sending;   ///< [-] transactions that send some
    uint32_t sent;      ///< [-] PDUs
    uint32_t taken;     ///< [-] PDUs without a fault
    uint32_t refused;   ///< [-] PDUs that were dropped: damaged, for another entity, of no transaction
    uint32_t lost;      ///< [-] PDUs that came when there was no room for them
    uint32_t received;  ///< [-] files that are whole
    uint32_t delivered; ///< [-] files that were sent, and in class 2 have arrived
    uint32_t failed;    ///< [-] transactions that ended without their file
    uint32_t condition; ///< [-] CfdpCondition of the last fault; 0: there was none
    uint32_t used;      ///< [-] bytes of the store; of another one than its own: 0
    uint32_t free;      ///< [-] bytes of the store
    uint32_t waiting;   ///< [-] pages that are to be read from the recorder, or written to it
    uint32_t dropped;   ///< [-] files that were not whole in the recorder at the start
    uint32_t booted;    ///< [-] in [0, 1]: 1: each table of the start was loaded or refused
    uint32_t tables;    ///< [-] tables that were loaded
} FilesState;

enum { LINK_FAULTS = 16 };

/** The link of frames to the ground. Its counters begin when the computer does. */
typedef struct LinkState {
    Head head;
    uint32_t accepted;            ///< [-] frames of commands that FARM-1 accepted
    uint32_t discarded;           ///< [-] those that it did not
    uint32_t packets;             ///< [-] commands in them
    uint32_t sent;                ///< [-] frames of telemetry
    uint32_t unsent;              ///< [-] those without protection, which were not sent
    uint32_t corrected;           ///< [-] codeblocks of CLTUs with one wrong bit
    uint32_t farm;                ///< [-] 1: open, 2: wait, 3: lockout
    uint32_t next;                ///< [-] V(R), the number of the next frame
    uint32_t faults[LINK_FAULTS]; ///< [-] CLTUs and frames that were refused, by CcsdsFault (ccsds/bytes.h)
} LinkState;

#endif

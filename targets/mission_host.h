/* SPDX-License-Identifier: Apache-2.0 */
/* The interface of a mission to its host: its functions, the layout and definitions of its messages, and its rates.
 * `fledge export` writes the data (MISSION_host.c).
 *
 * Example:
 *
 *     static void fly(const RegisterWindow *board, int64_t end)
 *     {
 *         MissionIoCounts counts = {0};
 *         mission_host_exchange(&fledge_mission, board, -1, &counts); // reset flight
 *         for (int64_t t = 0; t <= end; t = fledge_mission.next()) {
 *             mission_host_exchange(&fledge_mission, board, t, &counts);
 *         }
 *     }
 */
#ifndef TARGETS_MISSION_HOST_H
#define TARGETS_MISSION_HOST_H

#include "flight/command/activity.h"
#include "flight/telemetry/telemetry.h"
#include "record/mcap.h"
#include "targets/mission_io.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The definition of a message, for records and for co-simulation. */
typedef struct MissionDefinition {
    const char *type; ///< "NavAttitude"
    const char *name; ///< "fledge/msg/NavAttitude"
    const char *text; ///< in ros2msg
} MissionDefinition;

/** When flight sees a message that another process writes at t. */
typedef enum MissionLatency {
    MISSION_SAME_INSTANT = 0,
    MISSION_NEXT_INSTANT = 1, ///< the first one after t
    MISSION_NEXT_EXCHANGE = 2 ///< after the next exchange
} MissionLatency;

/** The topic of a message, and how flight receives it. */
typedef struct MissionTopic {
    const char *topic;   ///< "/world/nav/attitude"
    uint16_t definition; ///< its index in the list
    uint8_t latency;     ///< of an input: MissionLatency
    uint8_t optional;    ///< of an input: 1 if flight runs without it
} MissionTopic;

/** An event, for records. */
typedef struct MissionEvent {
    const char *name; ///< as in flight.py
    const char *when; ///< its condition in words
} MissionEvent;

/** The actions of the executive, for records: its mode, and the events that fired. */
typedef struct MissionExecutive {
    const char *mode_topic, *activity_topic; ///< "/flight/mode", "/flight/activity"
    const MissionDefinition *definitions;    ///< of ProcessMode and Activity
    const char *const *modes;                ///< their names as in flight.py; n_modes of the commands
    const MissionEvent *events;              ///< n_events of the commands
    uint16_t (*mode)(const void *mission);   ///< the one in force
    const ExecEvent *(*event)(const void *mission, uint16_t event);
} MissionExecutive;

enum { MISSION_NO_RESET = 0xFFFF };

/** The heap of a mission that has one, as of a script. */
typedef struct MissionHeap {
    size_t used; ///< [bytes] now
    size_t peak; ///< [bytes] the most so far
} MissionHeap;

typedef struct MissionHost {
    const char *name;
    void *mission; ///< its memory
    MissionStart *start;
    void (*init)(void);
    void (*restart)(int64_t t);
    int64_t (*next)(void);
    void (*tick)(int64_t t);
    const char *(*failure)(void);                 ///< after init: NULL, or why it failed; NULL itself: it cannot
    void (*describe)(void (*line)(const char *)); ///< print the composition of the mission's script; NULL: it has none
    void (*figures)(void (*line)(const char *));  ///< print the actions of the mission's script; NULL: it has none
    int64_t (**clock)(void);                      ///< [ns] where to put a monotonic clock for them; NULL: nowhere
    const MissionIo *io;
    const MissionTopic *topics; ///< of each message, by id
    const MissionDefinition *definitions;
    const ExecRate *rates;
    const CommandTable *commands;
    const TelemetryTable *telemetry;
    const MissionExecutive *executive;
    const void **store;    ///< where to put a CfdpStore for the files of flight; NULL: it has none
    const void **keys;     ///< where to put a SdlsProvider for its link of frames; NULL: that is not secured
    CommandState *state;   ///< memory for that of the commands
    McapSchema *schemas;   ///< memory for the schemas of the record
    McapChannel *channels; ///< memory for the channels of the record
    uint16_t n_schemas;
    uint16_t n_channels;
    uint16_t n_rates;
    uint16_t reset; ///< the id of the ComputerReset by which the outside resets the computer; MISSION_NO_RESET: none
    int64_t down;   ///< [ns] how long the computer is down after it
    MissionHeap (*heap)(void); ///< NULL: the mission has none
} MissionHost;

extern const MissionHost fledge_mission;

/** One exchange: with t < 0 reset flight; else execute the commands that came, read, tick, and send telemetry; then
 *  write. If the computer was reset, or the program started within the run, flight first begins at t with the
 *  parameters that it was built with. The caller calls register_clock_finish when it has finished its own
 *  work of this tick. */
void mission_host_exchange(const MissionHost *host, const RegisterWindow *w, int64_t t, MissionIoCounts *counts);

/** A hash in which the outside and flight must agree, although each has its own program: names, types and layouts of
 *  all messages, rates, boards, and wires. */
uint64_t mission_host_hash(const MissionHost *host);

/** Records every output of flight at every tick, and the actions of its executive, as MCAP, without a heap. */
typedef struct MissionRecord {
    McapWriter writer;
    uint16_t first;        ///< the first channel; the others follow
    uint16_t executive[2]; ///< the channels of the modes and of the activity; 0: none yet
    uint16_t spare;
    uint16_t open;
    uint32_t reported; ///< how many of the reports of the commands are recorded
    uint32_t resets;   ///< how many of the computer are
    ProcessMode mode;  ///< the last one recorded
    Activity activity; ///< the last one recorded
} MissionRecord;

/** Begin a record, whose bytes go to `write`. */
McapStatus mission_record_open(MissionRecord *r, const MissionHost *host, McapWrite write, void *user,
                               const char *target);

/** Record all outputs of flight, at t >= 0. */
McapStatus mission_record_take(MissionRecord *r, const MissionHost *host, int64_t t);

McapStatus mission_record_close(MissionRecord *r);

#ifdef __cplusplus
}
#endif

#endif

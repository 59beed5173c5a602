/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static EventLog m = {.par = {.window = 60.0, .least = EVENT_LOW, .most = 10}};
 *
 *     // The services of the mission, for flight/command: it calls their functions with their modules.
 *     static void *const modules[] = {&m};
 *     static const CommandService *const services[] = {&event_log_service};
 */
#ifndef FLIGHT_SERVICES_EVENT_LOG_H
#define FLIGHT_SERVICES_EVENT_LOG_H

#include "flight/command/command.h"
#include "flight/msg/event.h"
#include "flight/msg/services.h"

enum { EVENTS_KEPT = 32, EVENT_SOURCES = 24, EVENT_FILTERS = 8, EVENTS_AT_ONCE = 4 };

/** What is logged of one output, in place of the log's own rules. */
typedef struct EventFilter {
    uint32_t on;     ///< [-] in [0, 1]: 1: it counts
    uint32_t output; ///< [-] place in the dictionary
    uint32_t least;  ///< [-] in [0, 5]: the least severity that is logged; 5: none is
    uint32_t most;   ///< [-] how many in each `window`; 0: all
} EventFilter;

/** An event in the log, and in its packet, where each number is big-endian. */
typedef struct EventRecord {
    int64_t t;           ///< [ns] of the event
    uint32_t number;     ///< [-] counts the records, from 1
    uint32_t before;     ///< [-] events of its output since the record before that are not logged: there were too many,
                         ///< or others replaced them in the output
    uint16_t output;     ///< [-] place in the dictionary
    uint16_t severity;   ///< [-] EventSeverity
    uint32_t id;         ///< [-] which event of its output
    double arguments[4]; ///< [SI] as the event has them
} EventRecord;

/** How far the log has seen an output. */
typedef struct EventSource {
    int64_t t;         ///< [ns] of the last event
    int64_t begun;     ///< [ns] the window
    uint32_t sequence; ///< [-] of the last event
    uint32_t count;    ///< [-] of the last event
    uint32_t logged;   ///< [-] in the window
    uint32_t before;   ///< [-] of the next record
} EventSource;

/** Keeps what the modules of the process say and sends it, one packet for each event.
 *
 *  At the end of each instant it looks at the outputs that are events, 24 at most. It logs those that are grave enough,
 *  of each output at most so many in a time; a filter has other rules for an output. What it does not log it counts.
 *  The last 32 records stay, also over a reset of flight; a run of which the time begins anew begins without any. The
 *  command 26 sends them again, the oldest first, 4 at each update. */
typedef struct EventLog {
    struct {
        EventLogState state;
    } out;
    struct {
        double window;                      ///< [s] >= 0: the time in which the events of an output are counted
        uint32_t least;                     ///< [-] in [0, 5]: the least severity that is logged
        uint32_t most;                      ///< [-] how many of an output are logged in each window; 0: all
        EventFilter filters[EVENT_FILTERS]; ///< of outputs with other rules; the first that is on counts
    } par;
    struct {
        EventRecord records[EVENTS_KEPT]; ///< record number n at (n - 1) modulo 32
        EventSource sources[EVENT_SOURCES];
        int64_t seen;        ///< [ns] the last instant
        uint32_t begun;      ///< [-] 1: there was one since the reset
        uint32_t number;     ///< [-] of the last record
        uint32_t sent;       ///< [-] the number of the last that was sent
        uint32_t again;      ///< [-] the number of the next that is sent again,
        uint32_t until;      ///< [-] and of the last
        uint32_t left;       ///< [-] how many are sent again before the next update
        uint32_t below;      ///< [-] of the state
        uint32_t suppressed; ///< [-] of the state
        uint32_t replaced;   ///< [-] of the state
        uint32_t unseen;     ///< [-] of the state
    } mem;
} EventLog;

void event_log_reset(EventLog *m);
void event_log_update(EventLog *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService event_log_service;

#endif

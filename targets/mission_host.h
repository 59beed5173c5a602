/* SPDX-License-Identifier: Apache-2.0 */
/* All that a host knows of a mission: what to call, where its messages lie, what they look like, and
 * when it steps. The data are generated (MISSION_host.c). */
#ifndef TARGETS_MISSION_HOST_H
#define TARGETS_MISSION_HOST_H

#include "record/mcap.h"
#include "targets/mission_io.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a message looks like, in records and in the co-simulation. */
typedef struct MissionDefinition {
    const char *type; ///< "NavAttitude"
    const char *name; ///< "fledge/msg/NavAttitude"
    const char *text; ///< in ros2msg
} MissionDefinition;

/** A message's name to others, and how it comes in. */
typedef struct MissionTopic {
    const char *topic;   ///< "/world/nav/attitude"
    uint16_t definition; ///< its place in the list
    uint8_t latency;     ///< of what comes in: 0, or 1 exchange
    uint8_t optional;    ///< of what comes in: 1 if flight does without
} MissionTopic;

typedef struct MissionHost {
    const char *name;
    void *mission; ///< its memory
    void (*init)(void);
    void (*reset)(void);
    int64_t (*next)(void);
    void (*tick)(int64_t t);
    const MissionIo *io;
    const MissionTopic *topics; ///< of each message, by id
    const MissionDefinition *definitions;
    const ExecRate *rates;
    McapSchema *schemas;   ///< room for those of the record ...
    McapChannel *channels; ///< ... and its topics
    uint16_t n_schemas;
    uint16_t n_channels;
    uint16_t n_rates;
} MissionHost;

extern const MissionHost fledge_mission;

/** One exchange by the board's clock: begin, or read, tick and write. The caller then
 *  answers the clock (register_clock_finish), when it has done the rest of its tick. */
void mission_host_exchange(const MissionHost *host, const RegisterWindow *w, int64_t t, MissionIoCounts *counts);

/** Every output of flight at every tick, in the archive's format, without heap. */
typedef struct MissionRecord {
    McapWriter writer;
    uint16_t first; ///< channel; the others follow
    uint16_t open;
} MissionRecord;

/** Begin a record that goes to `write`. `chunk` may be of size 0: see record/mcap.h. */
McapStatus mission_record_open(MissionRecord *r, const MissionHost *host, McapWrite write, void *user,
                               const char *target);

/** Record all that flight puts out, at t >= 0. */
McapStatus mission_record_take(MissionRecord *r, const MissionHost *host, int64_t t);

McapStatus mission_record_close(MissionRecord *r);

#ifdef __cplusplus
}
#endif

#endif

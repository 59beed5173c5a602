/* SPDX-License-Identifier: Apache-2.0 */
/* The record of a mission's outputs, which the board sends. It outlives a reset of the board: the program that starts
 * again goes on with it. */
#ifndef TARGETS_BARE_RECORDER_H
#define TARGETS_BARE_RECORDER_H

#include "targets/mission_host.h"

enum { RECORDER_SCHEMAS = 64, RECORDER_CHANNELS = 192 };

/** The state that survives a reset of the board. */
typedef struct RecorderKept {
    uint32_t begun; ///< a mark: the rest is of the program before a reset
    uint32_t busy;  ///< 1: some bytes of a record are sent
    uint32_t taken;
    uint32_t closed;  ///< 1: the record has its end
    int64_t answered; ///< [ns] the tick that flight has answered, until it is recorded; -1: none
    McapStatus status;
    MissionRecord record;
    McapSchema schemas[RECORDER_SCHEMAS];
    McapChannel channels[RECORDER_CHANNELS];
} RecorderKept;

/** At the start of the program: go on with the record of the program before a reset, if there was one. */
void recorder_resume(void);
/** Begin the record of a run, if the outside takes one. */
void recorder_begin(const MissionHost *host, const char *target);
/** Before flight answers a tick: so a reset between the answer and the record of the tick is known. */
void recorder_answer(int64_t t);
/** Record all outputs of flight, at t >= 0; without a record, begin one. Errors wait for the end. */
void recorder_take(const MissionHost *host, int64_t t, const char *target);
/** End the record, and print the counters on the console, a key and a value on each line. Returns the exit code of the
 *  program. */
int recorder_end(const MissionIoCounts *counts);

#endif

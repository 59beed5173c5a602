/* SPDX-License-Identifier: Apache-2.0 */
/* The record of a mission's outputs, sent through the last UART. It outlives a reset of the board: the program that
 * starts again goes on with it. */
#ifndef TARGETS_LEON3_RECORDER_H
#define TARGETS_LEON3_RECORDER_H

#include "targets/mission_host.h"

/** At the start of the program: go on with the record of the program before a reset, if there was one. */
void recorder_resume(void);
/** Begin the record of a run. */
void recorder_begin(const MissionHost *host, const char *target);
/** Record all outputs of flight, at t >= 0; without a record, begin one. Errors wait for the end. */
void recorder_take(const MissionHost *host, int64_t t, const char *target);
/** End the record, and print the counters on the console, a key and a value on each line. Returns the exit code of the
 *  program. */
int recorder_end(const MissionIoCounts *counts);

#endif

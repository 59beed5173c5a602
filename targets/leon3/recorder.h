/* SPDX-License-Identifier: Apache-2.0 */
/* The record of a mission's outputs, sent through the last UART. It outlives a reset of the board: the program that
 * starts again goes on with it. */
#ifndef TARGETS_LEON3_RECORDER_H
#define TARGETS_LEON3_RECORDER_H

#include "targets/mission_host.h"

/** Begin the record, or go on with that of the program before a reset. */
void recorder_open(const MissionHost *host, const char *target);
/** Record all outputs of flight, at t >= 0. Errors wait for the end. */
void recorder_take(const MissionHost *host, int64_t t);
/** End the record, and print the counters on the console, a key and a value on each line. Returns the exit code of the
 *  program. */
int recorder_end(const MissionIoCounts *counts);

#endif

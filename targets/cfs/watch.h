/* SPDX-License-Identifier: Apache-2.0 */
/* For `fledge fly`: records the outputs of an app and its processor time. An app that `fledge export cfs` wrote calls
 * it if NAME_WATCH is defined. */
#ifndef TARGETS_CFS_WATCH_H
#define TARGETS_CFS_WATCH_H

#include "flight/command/command.h"
#include "targets/mission_io.h"

/** Call it after each tick at t, with t = -1 at the end of the run, and with t = -2 when the app ends otherwise. It
 *  writes all outputs into the file $FLEDGE_RECORD, or, if that exists, into one with a number behind its name; at the
 *  end of the run it prints its counters. If $FLEDGE_END is set, it then ends the process, because a core continues
 *  without apps. */
void fledge_watch(const void *mission, CommandState *commands, MissionStart *start, int64_t t,
                  const MissionIoCounts *counts);

#endif

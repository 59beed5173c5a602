/* SPDX-License-Identifier: Apache-2.0 */
/* For `fledge fly`: records the outputs of an app and its processor time. An app that `fledge export cfs` wrote calls
 * it if NAME_WATCH is defined. */
#ifndef TARGETS_CFS_WATCH_H
#define TARGETS_CFS_WATCH_H

#include "targets/mission_io.h"

/** Call it after each tick at t, and with t < 0 at the end of the run. It writes all outputs into the file
 * $FLEDGE_RECORD,
 *  and at the end prints its counters on the standard output. If $FLEDGE_END is set, it then ends the process, because
 * a
 *  core continues without apps. */
void fledge_watch(const void *mission, int64_t t, const MissionIoCounts *counts);

#endif

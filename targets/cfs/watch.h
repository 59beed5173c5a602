/* SPDX-License-Identifier: Apache-2.0 */
/* For `fledge fly`: the record of an app, and what it took. The app calls it; see NAME_WATCH in what
 * `fledge export cfs` writes. */
#ifndef TARGETS_CFS_WATCH_H
#define TARGETS_CFS_WATCH_H

#include "targets/mission_io.h"

/** After each tick at t, and with t < 0 at the end of the run. All outputs go into $FLEDGE_RECORD; in
 *  the end, lines on the standard output say what was done. With $FLEDGE_END the process then ends,
 *  for a core goes on without its apps. */
void fledge_watch(const void *mission, int64_t t, const MissionIoCounts *counts);

#endif

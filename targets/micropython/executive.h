/* SPDX-License-Identifier: Apache-2.0 */
/* The executive of a mission whose script composes it at run time: tasks, wires, modes and events as data, run by the
 * rules of flight/exec. It is the mission of targets/mission_host.h where MicroPython flies. */
#ifndef TARGETS_MICROPYTHON_EXECUTIVE_H
#define TARGETS_MICROPYTHON_EXECUTIVE_H

#include "targets/micropython/tables.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Start the interpreter, run the script, check what it composed, lock the arena. A script that fails leaves a mission
 *  without tasks; executive_failure() says why. */
void executive_init(void);

/** NULL, or why the script did not compose the mission: "flight.py, line 12: ..." */
const char *executive_failure(void);

/** The functions of targets/mission_host.h and flight/command/command.h. */
void executive_restart(int64_t t);
int64_t executive_next(void);
void executive_tick(int64_t t);
void executive_enter(uint16_t mode);
uint16_t executive_mode(void);
void executive_publish(uint16_t block, int64_t t);
void executive_arm(uint16_t event, int on);

/** Print what the script composed, a line at a time: parameters as bytes, wires, tasks, modes, events, the heap. The
 *  export compares it with what the desktop composed. */
void executive_describe(void (*line)(const char *text));

#ifdef __cplusplus
}
#endif

#endif

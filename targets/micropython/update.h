/* SPDX-License-Identifier: Apache-2.0 */
/* Modules whose update is the script's: `fsw.SunSlew(update=slew, reset=begin, turns=2000)`. The executive calls
 * slew(m, t, dt) in place of the C function, with times in seconds, and begin(m) after the C reset.
 *
 * Where such a function raises, allocates or takes more turns than it may, its module is as before the call, but for
 * the heads of its outputs, which are held (head_held). A text of telemetry has the reason: at the first failure, at
 * one for another reason, and then when the number of failures has doubled. Flight goes on. */
#ifndef TARGETS_MICROPYTHON_UPDATE_H
#define TARGETS_MICROPYTHON_UPDATE_H

#include "targets/micropython/executive.h"
#include "targets/micropython/objects.h"

enum { UPDATE_TURNS = 5000 }; /* of loops and returns of functions in one update, if a script sets no other limit */

/** A module with functions of the script has its place: the executive calls them from now on. */
void update_install(ScriptRoot *module);

/** Forget those of an earlier start. */
void update_begin(void);

/** The module whose function runs now, or NULL. */
const ScriptRoot *update_running(void);

/** m.publish(m.reference, quality="GOOD") and m.held(m.reference) */
MP_DECLARE_CONST_FUN_OBJ_KW(update_publish_object);
MP_DECLARE_CONST_FUN_OBJ_2(update_held_object);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* Programs of the ground, run on board beside the mission's script: procedures, which are bytecode with a function
 * `main(f)`, and in a build of development lines of text.
 *
 * Each has a heap of its own, and its own names; when it ends, all of that is gone, and the script's is as it was. It
 * sees copies of the modules that it reads, made at the beginning of its turn. At the end of the turn the parameters
 * that it has changed are written as by a command. A text may change messages and memory, too.
 *
 * A turn of a procedure is what it does at one instant of flight, after its tasks and events: until `yield`, which
 * gives the next instant, or `yield wait(time)`. It ends when main returns, or when it raises, has no memory left, or
 * takes more turns of its loops and returns of functions in one instant than its start allows. */
#ifndef TARGETS_MICROPYTHON_PROCEDURE_H
#define TARGETS_MICROPYTHON_PROCEDURE_H

#include "flight/command/command.h"

#ifdef __cplusplus
extern "C" {
#endif

/** For the table of commands. */
extern const CommandProcedures script_procedures;

/** The interpreter starts anew: forget the running procedures. */
void procedure_forget(void);

/** Flight begins anew: end the running procedures. */
void procedure_end(void);

/** After flight's instant t: let the procedure have its turn, if it does not wait. */
void procedure_run(int64_t t);

#ifdef __cplusplus
}
#endif

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The functions that flight needs from a board without an operating system: main.c and recorder.c call
 * them. targets/leon3 implements them over a register space, line_board.c over a serial line and the five functions of
 * port.h. Nothing here uses a heap.
 *
 * The order of the calls: bare_keep, bare_begin, then all others, and bare_end at last. */
#ifndef TARGETS_BARE_BARE_H
#define TARGETS_BARE_BARE_H

#include "targets/mission_host.h"

#include <stddef.h>
#include <stdint.h>

/** The name of the target in records and in the greeting of a line: the compiler's command line has it. */
#ifndef TARGET
#define TARGET "bare"
#endif

/** Fly the exported mission of this program until the outside ends the run; returns the exit status, which bare_end has
 *  reported already. A task of an operating system calls it; without one, main of main.c does, unless the program has a
 *  main of its own. */
int fledge_fly(void);

/** `size` bytes, aligned to 8, that a reset leaves as they are; after power-on they are anything. Called once, and
 *  before bare_begin. */
void *bare_keep(size_t size);

/** Place a window on each board of the mission, with the `ring` of the clock's; windows: io->n_boards of them. A line
 *  waits here for the greeting of the outside, and keeps the watchdog quiet meanwhile. */
void bare_begin(const MissionHost *mission, RegisterWindow *windows);

/** Sleep, or receive, until something may have changed in the windows; at most for 100 ms. Once bare_watch was called,
 *  the watchdog resets the board when this was not called for BARE_PATIENCE_S. */
void bare_idle(void);
void bare_watch(void);
enum { BARE_PATIENCE_S = 10 };

/** [ns] since the start. */
int64_t bare_now(void);

/** A piece of text on the console. Before bare_begin it may be lost. */
void bare_say(const char *text);
/** By bare_say, in say.c; a figure is a line of a key and a value. */
void bare_say_number(uint32_t value);
void bare_say_hex(uint32_t value);
void bare_say_figure(const char *key, uint32_t value);

/** A record begins, goes on after a reset, or has ended: a console that shares its wire is silent meanwhile. */
typedef enum BareRecording { BARE_RECORD_ENDED = 0, BARE_RECORD_GOES_ON = 1, BARE_RECORD_BEGINS = 2 } BareRecording;
void bare_recording(BareRecording state);
/** Whether the outside takes a record; it is known after bare_begin. */
int bare_records(void);
/** Send bytes of the record. After bare_record_flush a reset of the board loses none of them. */
void bare_record(const void *bytes, size_t n);
void bare_record_flush(void);

/** Figures of the board at the end of a run: program_bytes, data_bytes, ram_bytes, stack_bytes, as it knows them. */
void bare_say_figures(void);

/** The run has ended, with an exit status: returns when the outside knows. */
void bare_end(int status);

#endif

/* SPDX-License-Identifier: Apache-2.0 */
/* The inputs of flight in an earlier run, from a file: messages and commands, before each instant of flight.
 * The same flight software then computes the same bits without the world. The file is mapped and checked as a whole, so
 * that playing it neither allocates nor fails. All numbers have the byte order of the machine:
 *
 *     INPUTS_MAGIC, then records: int64 t [ns], uint32 kind, uint32 n, n bytes, zeros up to a multiple of 8
 *
 * `kind` is the id of a message that flight reads, INPUTS_COMMAND for a packet, or INPUTS_INSTANT, which has no bytes
 * and ends the records of its t. INPUTS_MARK has no bytes either: it calls inputs_mark, where a profiler can stop. */
#ifndef TARGETS_LINUX_INPUTS_H
#define TARGETS_LINUX_INPUTS_H

#include "targets/mission_io.h"

#define INPUTS_MAGIC UINT64_C(0x31535455504E4946) /* "FINPUTS1" on a little-endian machine */
#define INPUTS_COMMAND UINT32_C(0xFFFFFFFF)
#define INPUTS_INSTANT UINT32_C(0xFFFFFFFE)
#define INPUTS_MARK UINT32_C(0xFFFFFFFD)

typedef struct Inputs {
    const uint8_t *at; ///< the next record
    const uint8_t *end;
} Inputs;

/** Map and check a file. Returns NULL, or its fault. */
const char *inputs_open(Inputs *inputs, const char *path, const MissionIo *io);

/** The next instant [ns]; INT64_MAX after the last. */
int64_t inputs_next(const Inputs *inputs);

/** Write the inputs of the next instant into the lanes. */
void inputs_put(Inputs *inputs, const MissionIo *io, const RegisterWindow *w, MissionIoCounts *counts);

/** Does nothing. */
void inputs_mark(void);

#endif

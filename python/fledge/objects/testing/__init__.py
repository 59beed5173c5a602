# SPDX-License-Identifier: Apache-2.0
"""For tests: a library of modules with fields of every kind."""

import functools
import subprocess
import sys
import tempfile
from pathlib import Path

from fledge import objects
from fledge.elements import ELEMENTS

ROOT = Path(__file__).resolve().parents[4]
HEADER = """
#ifndef KINDS_NOISE_H
#define KINDS_NOISE_H
#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** What a part does. */
typedef enum Phase {
    PHASE_NOT_SAFE = -7, ///< it fails
    PHASE_SAFE = 0,      ///< it rests
    PHASE_SCIENCE = 3,   ///< it works
    PHASE_DRAIN = 100    ///< it empties
} Phase;

/** A pair of numbers. */
typedef struct Pair {
    int64_t count; ///< [-] a whole number
    double x;      ///< [m] a length
} Pair;

/** A part of the numbers. */
typedef struct Part {
    Phase phase;     ///< [-] what it does
    float share;     ///< [-] of the whole
    Pair pairs[2];   ///< two of them
    int16_t steps[4]; ///< [-] whole numbers
} Part;

/** A number of every kind. */
typedef struct Kinds {
    Head head;
    double x;           ///< [m] a length
    double y;           ///< [m] another one
    double rate;        ///< [rad/s] a rate
    float single;       ///< [-] a number
    int8_t i8;          ///< [-] a whole number
    uint8_t u8;         ///< [-] a whole number
    int16_t i16;        ///< [-] a whole number
    int32_t i32;        ///< [-] a whole number
    uint32_t u32;       ///< [-] a whole number
    uint16_t u16[2];    ///< [-] whole numbers
    uint32_t spare;
    int64_t i64;        ///< [-] a whole number
    uint64_t u64;       ///< [-] a whole number
    int64_t since;      ///< [ns] a time
    int64_t wide[2];    ///< [-] whole numbers
    uint64_t serials[2]; ///< [-] whole numbers
    Phase phase;        ///< [-] what it does
    Phase phases[3];    ///< [-] what others do
    Vec3 v;             ///< [m] a vector
    Mat3 turn;          ///< [-] a matrix
    double grid[2][3];  ///< [m] lengths
    Part part;          ///< one part
    Part parts[3];      ///< more of them
    char label[8];      ///< a name
} Kinds;

/** Put out its parameters, shuffled and changed at each update. */
typedef struct Noise {
    struct {
        Kinds hint; ///< optional: what it holds changes the draws
    } in;
    struct {
        Kinds kinds; ///< what it made
    } out;
    struct {
        double x;           ///< [m] >= 0: a length
        uint64_t seed;      ///< [-] of the changes
        int32_t step;       ///< [-] in [-100, 100]: a whole number
        uint8_t level;      ///< [-] in [0, 10]: a whole number
        uint8_t spare[3];
        Phase phase;        ///< [-] what it does
        Phase phases[3];    ///< [-] what others do
        uint16_t counts[2]; ///< [-] whole numbers
        uint32_t spare_2;
        int64_t wide[2];    ///< [-] whole numbers
        Vec3 v;             ///< [m] a vector
        Part part;          ///< one part
        Part parts[3];      ///< more of them
    } par;
    struct {
        uint64_t state; ///< [-] of the changes
    } mem;
} Noise;

/** Publish what its parameters say. */
typedef struct Flags {
    struct {
        Kinds kinds; ///< what they say
    } out;
    struct {
        double x;        ///< [m] a length
        int64_t i64;     ///< [-] a whole number
        Phase phase;     ///< [-] what to do
        uint32_t spare;
    } par;
} Flags;

/** A module with nothing but an input. */
typedef struct Sink {
    struct {
        Kinds kinds; ///< optional: not used
    } in;
} Sink;

void noise_reset(Noise *m);
void noise_update(Noise *m, Tick t);
void flags_reset(Flags *m);
void flags_update(Flags *m, Tick t);
void sink_reset(Sink *m);
void sink_update(Sink *m, Tick t);
#endif
"""
SOURCE = """
#include "kinds/noise.h"

#include <string.h>

static const Phase PHASES[] = {PHASE_NOT_SAFE, PHASE_SAFE, PHASE_SCIENCE, PHASE_DRAIN};

/* SplitMix64 */
static uint64_t draw(uint64_t *state)
{
    uint64_t z = (*state += UINT64_C(0x9E3779B97F4A7C15));
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

static int64_t small(uint64_t *state)
{
    return (int64_t)(draw(state) % 7) - 3;
}

static Phase any(uint64_t *state)
{
    return PHASES[draw(state) % 4];
}

/* Neighbours of 0, 2^53, 2^62, which one double may stand for. */
static int64_t large(uint64_t *state)
{
    static const int64_t around[] = {0, INT64_C(1) << 53, -(INT64_C(1) << 53), INT64_C(1) << 62};
    return around[draw(state) % 4] + small(state);
}

static void fill(Part *p, uint64_t *state)
{
    p->phase = any(state);
    p->share = (float)small(state) * 0.1F;
    for (int i = 0; i < 2; i++) {
        p->pairs[i].count = large(state);
        p->pairs[i].x = (double)small(state);
    }
    for (int i = 0; i < 4; i++) {
        p->steps[i] = (int16_t)small(state);
    }
}

void noise_reset(Noise *m)
{
    memset(&m->out, 0, sizeof m->out);
    m->mem.state = m->par.seed;
}

/* A number of all numbers of a message, the same in any byte order. */
static uint64_t digest(const Kinds *k)
{
    const double reals[] = {k->x, k->y, k->rate, k->single, k->v.v[1], k->turn.m[2][2], k->grid[1][1],
                            k->parts[2].share, k->parts[1].pairs[1].x};
    const int64_t whole[] = {k->head.t, (int64_t)k->head.quality, k->head.sequence, k->i8, k->u8, k->i16, k->i32,
                             k->u32, k->u16[1], k->i64, (int64_t)k->u64, k->since, k->wide[1], (int64_t)k->serials[0],
                             (int64_t)k->phase, (int64_t)k->phases[2], (int64_t)k->parts[0].phase,
                             k->parts[1].pairs[0].count, k->part.steps[3], k->label[0]};
    uint64_t sum = 0;
    for (size_t i = 0; i < sizeof whole / sizeof whole[0]; i++) {
        sum = sum * UINT64_C(0x100000001B3) + (uint64_t)whole[i];
    }
    for (size_t i = 0; i < sizeof reals / sizeof reals[0]; i++) {
        uint64_t bits;
        memcpy(&bits, &reals[i], sizeof bits);
        sum = sum * UINT64_C(0x100000001B3) + bits;
    }
    return sum;
}

void noise_update(Noise *m, Tick t)
{
    uint64_t *s = &m->mem.state;
    Kinds *k = &m->out.kinds;
    const Head head = head_next(k->head, t.t, quality_optional(m->in.hint.head));
    if (head_written(m->in.hint.head)) {
        *s ^= digest(&m->in.hint);
    }
    memset(k, 0, sizeof *k);
    k->head = head;
    k->x = m->par.x + (double)small(s);
    k->y = draw(s) % 5 == 0 ? k->x : (double)small(s);
    k->rate = 0.25 * (double)small(s);
    k->single = (float)small(s) * 0.1F;
    k->i8 = (int8_t)(small(s) * 42);
    k->u8 = (uint8_t)(small(s) * 42);
    k->i16 = (int16_t)(small(s) * 10922);
    k->i32 = m->par.step + (int32_t)small(s);
    k->u32 = (uint32_t)small(s);
    k->u16[0] = m->par.counts[0];
    k->u16[1] = (uint16_t)small(s);
    k->i64 = large(s);
    k->u64 = (uint64_t)large(s);
    k->since = t.t - 1000000000 * small(s);
    for (int i = 0; i < 2; i++) {
        k->wide[i] = draw(s) % 3 == 0 ? k->i64 : large(s);
        k->serials[i] = draw(s) % 3 == 0 ? k->u64 : (uint64_t)large(s);
    }
    k->phase = any(s);
    for (int i = 0; i < 3; i++) {
        k->phases[i] = any(s);
        k->v.v[i] = m->par.v.v[i] + (double)small(s);
        k->turn.m[i][i] = (double)small(s);
        k->grid[i % 2][i] = (double)small(s);
        fill(&k->parts[i], s);
    }
    fill(&k->part, s);
    k->label[0] = (char)('a' + (int)(draw(s) % 26));
}

void flags_reset(Flags *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void flags_update(Flags *m, Tick t)
{
    m->out.kinds.head = head_next(m->out.kinds.head, t.t, QUALITY_GOOD);
    m->out.kinds.x = m->par.x;
    m->out.kinds.i64 = m->par.i64;
    m->out.kinds.phase = m->par.phase;
}

void sink_reset(Sink *m)
{
    (void)m;
}

void sink_update(Sink *m, Tick t)
{
    (void)m;
    (void)t;
}
"""


@functools.cache
def kinds():
    """(folder that holds kinds/noise.h and .c, the library's types by name), built and loaded once."""
    folder = tempfile.TemporaryDirectory()
    folders.append(folder)
    root = Path(folder.name)
    (root / "kinds").mkdir()
    (root / "kinds" / "noise.h").write_text(HEADER)
    (root / "kinds" / "noise.c").write_text(SOURCE)
    subprocess.run([sys.executable, "-m", "introspect", "--library", "kinds", "--root", root, "--modules", "kinds",
                    "--include", ROOT, "--out", root], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    subprocess.run(["gcc", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-shared", "-fPIC", "-ffp-contract=off",
                    "-I", root, "-I", ROOT, "-o", root / "kinds.so", root / "kinds_tables.c",
                    root / "kinds" / "noise.c"], check=True)
    return root, objects.load_library(str(root / "kinds.so"), "kinds")


folders: list[tempfile.TemporaryDirectory] = []


def decoded(struct, raw, base=0):
    """A struct's bytes as dicts, lists and numbers: whole numbers exactly, spares and texts left out."""
    import numpy as np

    decoded_ = {}
    for field in struct.fields:
        if field.spare or field.type == "char":
            continue
        at = base + field.offset
        if field.type == "struct":
            size = field.struct.size
            rows = [decoded(field.struct, raw, i) for i in range(at, at + field.size, size)]
            decoded_[field.name] = rows if field.shape else rows[0]
        else:
            values = np.frombuffer(raw, ELEMENTS[field.type].dtype, field.size // ELEMENTS[field.type].size, at)
            decoded_[field.name] = values.reshape(field.shape).tolist() if field.shape else values[0].item()
    return decoded_

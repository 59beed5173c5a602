# SPDX-License-Identifier: Apache-2.0
"""Round trips: what the exported C sets, compiled, is what Python had, byte for byte."""

import struct
import subprocess
import sys
from random import Random

import numpy as np
import pytest

from fledge import SetupError, export, objects
from fledge.export import c_values
from fledge.export.c_text import string
from fledge.export.testing import COMPILERS, ROOT, STRICT, Compiled
from fledge.mission.simulation import Simulation
from tests.circles import long_after

HEADER = """
#ifndef MINE_STORE_H
#define MINE_STORE_H
#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** What a cell does. */
typedef enum CellUse {
    CELL_OFF = 0,     ///< nothing
    CELL_CHARGE = 3,  ///< it fills
    CELL_DRAIN = -7   ///< it empties
} CellUse;

/** How a cell behaves at the limits. */
typedef struct CellLimit {
    double low;    ///< [V] least voltage
    Vec3 axis;     ///< [-] where it looks */ and /* what it does
} CellLimit;

/** One cell. */
typedef struct Cell {
    char label[12];       ///< what is painted on it
    CellUse use;          ///< what it does
    CellLimit limits[2];  ///< at both ends
    float share[3];       ///< [-] of the load
    uint8_t flags[4];     ///< [-] bits
} Cell;

/** A message of a store. */
typedef struct StoreState {
    Head head;
    double level[4]; ///< [V] of each cell
} StoreState;

/** Keep energy. */
typedef struct Store {
    struct {
        StoreState hint; ///< optional: from elsewhere
    } in;
    struct {
        StoreState state;
    } out;
    struct {
        Cell cells[3];        ///< the cells
        char name[16];        ///< of the store
        CellUse uses[8];      ///< [-] by phase
        double gains[5][2];   ///< [-] by phase and cell
        double table[40];     ///< [V] of charge
        Mat3 turn[2];         ///< [-] of the panels
        Vec3 points[4];       ///< [m] where they are
        int64_t epoch;        ///< [ns] of the charge
        uint64_t serial;      ///< [-] its number
        int32_t least;        ///< [-] a count
        uint32_t most;        ///< [-] a count
        int16_t small[3];     ///< [-] counts
        uint16_t big;         ///< [-] a count
        float drop;           ///< [V] over a diode
        int8_t signs[4];      ///< [-] of the poles
    } par;
} Store;

void store_reset(Store *m);
void store_update(Store *m, Tick t);
#endif
"""
SOURCE = """
#include "mine/store.h"

void store_reset(Store *m) { m->out.state.head = (Head){0, QUALITY_NONE, 0}; }

void store_update(Store *m, Tick t)
{
    m->out.state.head = head_next(m->out.state.head, t.t, QUALITY_GOOD);
}
"""


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    root = tmp_path_factory.mktemp("project")
    (root / "mine").mkdir()
    (root / "mine" / "store.h").write_text(HEADER)
    (root / "mine" / "store.c").write_text(SOURCE)
    subprocess.run([sys.executable, "-m", "introspect", "--library", "mine", "--root", root, "--modules", "mine",
                    "--include", ROOT, "--out", root], check=True, cwd=ROOT)
    subprocess.run(["gcc", "-shared", "-fPIC", "-ffp-contract=off", "-I", root, "-I", ROOT, "-o", root / "mine.so",
                    root / "mine_tables.c", root / "mine" / "store.c"], check=True)
    return root, objects.load_library(str(root / "mine.so"), "mine")


def finite(random, n):
    """Random bit patterns of doubles that a parameter may have."""
    values = np.frombuffer(random.randbytes(64 * n), dtype=np.float64)
    return values[(abs(values) >= 1e-100) & (abs(values) <= 1e100)][:n]


def fill(store, random):
    """Everything in a Store, with values of every kind."""
    for i, cell in enumerate(store.cells):
        cell.label = ["", "ünicode?", 'a "q"\\0'][i]
        cell.use = random.choice([0, 3, -7])
        cell.share = np.frombuffer(random.randbytes(12), dtype=np.uint32).astype(np.float32)
        cell.flags = list(random.randbytes(4))
        for limit in cell.limits:
            limit.low, *limit.axis[:] = finite(random, 4)
    store.name = "fifteen letters"
    store.uses = [random.choice([0, 3, -7]) for _ in range(8)]
    store.gains = finite(random, 10).reshape(5, 2)
    store.table = finite(random, 40)
    store.turn = finite(random, 18).reshape(2, 3, 3)
    store.points = finite(random, 12).reshape(4, 3)
    store.points[1] = [0.0, -0.0, 0.0]
    store.points[2] = 0.0
    store.epoch, store.serial = random.choice([-2**63, 2**63 - 1, -2**40, 7]), random.choice([2**64 - 1, 2**33, 5])
    store.least, store.most = random.choice([-2**31, 2**31 - 1, -3]), random.choice([2**32 - 1, 2**31, 4])
    store.small, store.big = [-2**15, 0, 2**15 - 1], 65535
    store.drop, store.signs = 0.1, [-128, 127, 0, -1]
    store.hint.level = finite(random, 4)            # an input without a writer keeps what it was given


def store_mission(mine, random, n=3):
    _, types = mine
    sim = Simulation("stores")
    f = sim.flight
    for i in range(n):
        setattr(f, f"store_{i}", types["Store"]())
        if i < n - 1:
            fill(getattr(f, f"store_{i}"), random)
    f.task("keep", every=1.0, run=[getattr(f, f"store_{i}") for i in range(n)])
    return sim


@pytest.mark.parametrize("compiler", long_after(1, COMPILERS, "another compiler"))
@pytest.mark.parametrize("seed", long_after(1, [1, 2], "more draws"))
def test_every_kind_of_parameter_comes_back_exactly(mine, seed, compiler, tmp_path):
    root, _ = mine
    sim = store_mission(mine, Random(seed))
    mission = export.read(sim)
    c = Compiled(mission, tmp_path, roots=[root], compiler=compiler)
    expected = b"".join(objects.memory(module) for module in sim.flight)
    assert c.memory.raw[-len(expected):] == expected


def test_only_what_is_not_zero_is_set(mine):
    mission = export.read(store_mission(mine, Random(4)))
    init = export.emit_c(mission)["stores.c"].partition("stores_reset(m);")[0]
    assert "store_2" not in init                    # it was given nothing
    assert "m->store_0.par.points[1].v[1] = -0.0;" in init
    assert "points[2]" not in init
    assert "CELL_" in init and 'par.name, "fifteen letters", 15' in init


@pytest.mark.parametrize("compiler", COMPILERS)
def test_doubles_of_any_bits_survive_a_compiler(compiler, tmp_path):
    special = [0.0, -0.0, 5e-324, -5e-324, 2.2250738585072014e-308, 2.225073858507201e-308, 1.7976931348623157e308,
               700.0, 0.1, 1e22, 1e23, 123456789012345678.0]
    values = [*special, *finite(Random(5), 20000)]
    singles = np.frombuffer(Random(6).randbytes(4 * 20000), dtype=np.float32)
    singles = [float(x) for x in singles[np.isfinite(singles)]]
    (tmp_path / "t.c").write_text(
        f"extern const double d[{len(values)}];\nextern const float f[{len(singles)}];\n"
        f"const double d[] = {{{', '.join(c_values.double(float(x)) for x in values)}}};\n"
        f"const float f[] = {{{', '.join(c_values.single(x) for x in singles)}}};\n")
    subprocess.run([compiler, *STRICT, "-c", "-o", "t.o", "t.c"], cwd=tmp_path, check=True)
    for section, raw in ((".rodata", np.array(values).tobytes()), ("", np.array(singles, np.float32).tobytes())):
        assert raw in (tmp_path / "t.o").read_bytes(), section or "float"


@pytest.mark.parametrize("value, text", [
    (0, "0"), (-2**31, "INT32_MIN"), (2**31, "2147483648u"), (-2**31 - 1, "INT64_C(-2147483649)"),
    (-2**63, "INT64_MIN"), (2**63 - 1, "INT64_C(9223372036854775807)"), (2**63, "UINT64_C(9223372036854775808)")])
def test_integers_are_of_a_type_that_holds_them(value, text):
    assert c_values.integer(value) == text


def test_texts_are_plain_ascii_without_trigraphs():
    assert string(b'a"\\\n??(\xff1') == '"a\\"\\\\\\n?\\?(\\3771"'


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_a_number_that_is_not_finite_is_refused(mine, bad):
    sim = store_mission(mine, Random(7))
    sim.flight.store_1.hint.level[2] = bad          # a view passes no setter
    with pytest.raises(SetupError, match=r"flight\.store_1\.hint\.level\[2\] must be finite; found"):
        export.read(sim)


def test_reprs_are_the_shortest():
    assert [c_values.double(x) for x in (0.1, 700.0, -0.0, 1e22)] == ["0.1", "700.0", "-0.0", "1e+22"]
    assert c_values.single(struct.unpack("f", struct.pack("f", 0.1))[0]) == "0.1F"

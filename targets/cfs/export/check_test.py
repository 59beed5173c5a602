# SPDX-License-Identifier: Apache-2.0
"""The rules that tables are held against are the desktop's: the same verdict on every parameter, for random ones and
for those at the edges."""

import ctypes
import math
import random
import subprocess

import numpy
import pytest

import fledge
from fledge import export, objects
from fledge.commands import rules_of
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import tables
from fledge.export.commands import rules
from fledge.export.testing import ROOT, STRICT

APP = cfs.App("nav")


def compiled(tables, folder):
    """Table name -> function(bytes) -> the name of the field that breaks its rule, or None."""
    lines = ['#include "flight/command/rules.h"', ""]
    for table in tables:
        lines += [f"static const CommandRule Rules{table.name}[] = {{",
                  *rules(list(rules_of(table.fields, table.start))), "};", ""]
        lines += [f"const char *check_{table.name}(const void *block);",
                  f"const char *check_{table.name}(const void *block)", "{", "    uint32_t element;",
                  f"    const CommandRule *broken = command_check(Rules{table.name}, sizeof Rules{table.name} / "
                  f"sizeof Rules{table.name}[0],", "        block, &element);",
                  "    return broken ? broken->name : 0;", "}", ""]
    (folder / "rules.c").write_text("\n".join(lines))
    subprocess.run(["gcc", *STRICT, "-O1", "-shared", "-fPIC", "-I", ROOT, "rules.c", ROOT / "flight/command/rules.c",
                    "-o", "rules.so"], check=True, cwd=folder)
    so = ctypes.CDLL(str(folder / "rules.so"))

    def function(name):
        check = getattr(so, f"check_{name}")
        check.restype = ctypes.c_char_p
        return lambda raw: (check(raw) or b"").decode() or None

    return {table.name: function(table.name) for table in tables}


def edges(field):
    low, high, _, _ = field.bounds
    values = [0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, 1e-100, 1e100, 5e-324, 1.1e100, math.inf, -math.inf, math.nan]
    for end in (low, high):
        values += [] if end is None else [end, math.nextafter(end, math.inf), math.nextafter(end, -math.inf)]
    return values


def inertias(draw):
    """Bodies and no bodies: rotated principal moments, some of which break the triangle inequality."""
    q, _ = numpy.linalg.qr(numpy.array([[draw.gauss(0, 1) for _ in range(3)] for _ in range(3)]))
    moments = [draw.choice([1, 2, 3, draw.uniform(0.1, 4), 0, -1]) for _ in range(3)]
    matrix = q @ numpy.diag(moments) @ q.T
    return (matrix + matrix.T) / 2 if draw.random() < 0.8 else matrix + draw.choice([0, 1e-3]) * q


@pytest.mark.parametrize("name", ["triple_spiral", "nadir_spin"])
def test_tables_are_held_against_the_desktops_rules(name, tmp_path):
    sim = fledge.load(name)
    tables_ = tables.tables(export.read(sim), APP)
    check = compiled(tables_, tmp_path)
    draw = random.Random(5)
    verdicts = {True: 0, False: 0}
    for table in tables_:
        live = getattr(sim.flight, table.module.path[7:])
        assert check[table.name](table.content) is None
        for field in table.fields:
            if field.spare or field.type != "f64" or not field.shape:
                continue                                # an array has a view, which no setter looks at
            view = getattr(live, field.name)
            copy = numpy.array(view)
            if not view.size:
                continue                                # no row counts
            for trial in range(40):
                if field.inertia and trial % 2:
                    view[...] = inertias(draw)
                else:
                    view.flat[draw.randrange(view.size)] = draw.choice(edges(field))
                raw = objects.memory(live)[table.start:table.start + len(table.content)]
                try:
                    sim.run(0.0)
                    refused = False
                except fledge.SetupError as error:
                    refused = f"{table.module.path}.{field.name} " in str(error)
                    assert refused, error
                assert (check[table.name](raw) == field.name) == refused, (field.name, numpy.array(view))
                verdicts[refused] += 1
                view[...] = copy
    assert min(verdicts.values()) > 100


def test_scalars_and_whole_numbers_have_their_ranges(tmp_path):
    tables_ = tables.tables(export.read(fledge.load("nadir_spin")), APP)
    check = compiled(tables_, tmp_path)

    def with_(name, field, value):
        table = next(t for t in tables_ if t.name == name)
        at = next(f.offset for f in table.fields if f.name == field) - table.start
        raw = bytearray(table.content)
        raw[at:at + len(value)] = value
        return check[name](bytes(raw))

    assert with_("Wheels", "n", bytes([9, 0, 0, 0])) == "n" and with_("Wheels", "n", bytes(4)) == "n"
    assert with_("Wheels", "n", bytes([1, 0, 0, 0])) is None
    assert with_("Control", "K", bytes(8)) == "K"
    assert with_("Control", "K_I", bytes(8)) is None
    assert with_("Control", "K_I", numpy.float64(-5e-324).tobytes()) == "K_I"
    assert with_("Motor", "n_axes", bytes([4, 0, 0, 0])) == "n_axes"
    # Rows that do not count are not looked at.
    wheels = next(t for t in tables_ if t.name == "Wheels")
    at = next(f.offset for f in wheels.fields if f.name == "J") - wheels.start
    raw = bytearray(wheels.content)
    raw[at + 32:at + 40] = numpy.float64(-1).tobytes()
    assert check["Wheels"](bytes(raw)) is None
    raw[0] = 5
    assert check["Wheels"](bytes(raw)) in ("J", "axes_B")

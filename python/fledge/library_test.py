# SPDX-License-Identifier: Apache-2.0
"""A library of modules of one's own: read, compiled and loaded apart from Fledge, and wired to its modules."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import SetupError, flight as fsw, objects
from fledge.units import N, m

ROOT = Path(__file__).resolve().parents[2]
HEADER = """
#ifndef MINE_HALVE_H
#define MINE_HALVE_H
#include "flight/msg/vehicle.h"

/** Give a part of a torque. */
typedef struct Halve {
    struct {
        BodyTorque wanted;
    } in;
    struct {
        BodyTorque given;
    } out;
    struct {
        double part; ///< [-] required, in [0, 1]: how much of it
    } par;
} Halve;

void halve_reset(Halve *m);
void halve_update(Halve *m, Tick t);
#endif
"""
SOURCE = """
#include "mine/halve.h"

void halve_reset(Halve *m) { m->out.given.torque_B = vec3(0.0, 0.0, 0.0); }

void halve_update(Halve *m, Tick t)
{
    m->out.given.torque_B = vec_scale(m->par.part, m->in.wanted.torque_B);
    m->out.given.head = head_next(m->out.given.head, t.t, quality_through(m->in.wanted.head));
}
"""


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    root = tmp_path_factory.mktemp("project")
    (root / "mine").mkdir()
    (root / "mine" / "halve.h").write_text(HEADER)
    (root / "mine" / "halve.c").write_text(SOURCE)
    subprocess.run([sys.executable, "-m", "introspect", "--library", "mine", "--root", root, "--modules", "mine",
                    "--include", ROOT, "--out", root], check=True, cwd=ROOT)
    subprocess.run(["gcc", "-shared", "-fPIC", "-ffp-contract=off", "-I", root, "-I", ROOT, "-o", root / "mine.so",
                    root / "mine_tables.c", root / "mine" / "halve.c"], check=True)
    return root / "mine.so", objects.load_library(str(root / "mine.so"), "mine")


def test_a_module_of_ones_own(mine):
    Halve = mine[1]["Halve"]
    h = Halve(part=0.5)
    h.wanted = fsw.BodyTorque(torque_B=[2, 4, 6] * N * m)
    h.wanted.head.quality = "GOOD"
    h.update(t=1)
    np.testing.assert_array_equal(h.given.torque_B, [1, 2, 3])
    with pytest.raises(SetupError, match=r"Halve.part must be in \[0, 1\], found 2"):
        h.part = 2
    sim = fledge.Simulation()
    sim.flight.halve, sim.flight.motor = h, fsw.WheelTorques()
    sim.flight.connect(h.given >> sim.flight.motor.torque)


def test_what_is_no_library(mine, tmp_path):
    with pytest.raises(SetupError, match="cannot load the library .*nothing.so"):
        objects.load_library(str(tmp_path / "nothing.so"), "nothing")
    with pytest.raises(SetupError, match="does not export fledge_library_other"):
        objects.load_library(str(mine[0]), "other")


@pytest.mark.parametrize("words", [["-O", "-m", "fledge.cli", "list"], ["-OO", "-m", "fledge.targets"],
                                   ["-O", "-m", "fledge.pool.worker", "3"], ["-O", "-c", "import fledge"]])
def test_no_fledge_without_asserts(words):
    """Whatever a scenario asserts would hold."""
    done = subprocess.run([sys.executable, *words], cwd=ROOT / "python", capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.endswith(
        ": Python leaves out asserts, and asserts judge scenarios: start Python without -O, and unset the variable "
        "PYTHONOPTIMIZE\n")


def test_editors_see_every_name_of_the_package():
    text = Path(fledge.__file__).read_text(encoding="utf-8")
    (block,) = (node for node in ast.parse(text).body if isinstance(node, ast.If)
                and ast.unparse(node.test) == "TYPE_CHECKING")
    seen = [alias.asname or alias.name for node in block.body if isinstance(node, ast.ImportFrom)
            for alias in node.names]
    assert sorted(seen) == fledge.__all__


def test_a_clone_without_links_says_how_to_make_them(tmp_path):
    """git writes files in their place where core.symlinks is off."""
    (tmp_path / "fledge").mkdir()
    shutil.copy(fledge.__file__, tmp_path / "fledge")
    (tmp_path / "fledge/ground").write_text("../../ground/python")
    done = subprocess.run([sys.executable, "-c", "import fledge"], capture_output=True, text=True,
                          env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert "files in the place of symbolic links" in done.stderr and "sed -n 's/^120000.*\\t//p'" in done.stderr

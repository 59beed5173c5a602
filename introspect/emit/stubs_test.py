# SPDX-License-Identifier: Apache-2.0
"""Stubs as a type checker sees them: mypy accepts them, and finds what is wrong in a mission."""
import os
import subprocess
import sys

import pytest

from introspect.emit import stubs
from introspect.model import Kind
from introspect.reader import read
from introspect.sources import Source
from introspect.testing import ROOT, read_this, write_header
from tests.needs import skip_without

MISSION = """
from fledge import flight as fsw, world
from fledge.units import N, kg, m, s


def build(f):
    f.vehicle = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.control = fsw.MrpFeedback(K=2.531 * N * m, P=45.0)
    f.puff = fsw.SunSlew(rates=[[1, 2, 3]], gain=2)
    f.craft = world.Spacecraft(I_B=[1, 2, 3], gravity=[world.MARS])
    f.control.K = 5 * N * m
    f.control.P = [1, 2, 3]
    f.slew = fsw.SunSlew(gain=1, update=slew, reset=lambda m: None)


def slew(m: fsw.SunSlew, t: float, dt: float) -> None:
    m.torque.torque_B = [m.gain * dt, 0, 0]
    m.publish(m.torque, quality="GOOD")
    m.held(m.torque)
"""

SLEW = """/** Slews. */
typedef struct SunSlew {
    struct {
        BodyTorque torque;
    } out;
    struct {
        double gain;     ///< [N m] required, in [0, 8]: how "hard"
        Vec3 rates[8];   ///< [rad/s] where to
        Quality least;   ///< what an input must be
        char name[8];    ///< what it is called
        uint32_t spare;
    } par;
} SunSlew;
void sun_slew_reset(SunSlew *m);
void sun_slew_update(SunSlew *m, Tick t);"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With the stubs of Fledge and of a project."""
    folder = tmp_path_factory.mktemp("stubs")
    (folder / "flight").mkdir()
    header = write_header(folder, "flight/sun_slew.h", SLEW)
    header.write_text('#include "flight/msg/vehicle.h"\n' + header.read_text())
    model = read_this()
    project = read([Source(folder, "flight", Kind.MODULE, "slews")], [ROOT])
    for library in (model.library("flight"), model.library("world"), project.library("slews")):
        for name, text in stubs.emit(library).items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
    return folder


def mypy(folder, *files):
    """What mypy complains of in these files, a line each."""
    skip_without("mypy")
    built = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release") / "introspect/stubs"     # _core.pyi
    path = os.pathsep.join([str(folder / "stubs"), str(ROOT / "python"), str(built)])
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--check-untyped-defs", "--follow-imports", "silent", "--no-error-summary",
         "--cache-dir", str(folder / "cache"), "--config-file", "", *map(str, files)],
        env={**os.environ, "MYPYPATH": path}, capture_output=True, text=True, cwd=folder)
    assert done.returncode in (0, 1), done.stderr
    return done.stdout.splitlines()


@pytest.mark.long("mypy reads the types of all of Fledge: a minute")
def test_mypy_accepts_the_stubs_and_a_mission(folder):
    (folder / "flight.py").write_text(MISSION)
    nadir_spin = ROOT / "missions/nadir_spin"
    assert mypy(folder, *sorted((folder / "stubs").iterdir()), folder / "flight.py") == []
    assert mypy(folder, nadir_spin / "flight.py", nadir_spin / "world.py") == []


MISTAKES = [
    ("(K=2.531 * N * m", "(k=2.531 * N * m", 'Unexpected keyword argument "k" for "MrpFeedback"'),
    ("(K=2.531 * N * m", "(K='2.531'", 'Argument "K" to "MrpFeedback" has incompatible type "str"'),
    (", P=45.0", "", 'Missing named argument "P" for "MrpFeedback"'),
    ("[700, 700, 800] * kg * m**2", "[1, 2, 'x']", 'List item 2 has incompatible type "str"'),
    ("K = 5 * N * m", "K = 'stiff'", 'Incompatible types in assignment (expression has type "str"'),
    ("MrpFeedback", "MrpFeeback", 'Module has no attribute "MrpFeeback"; maybe "MrpFeedback"?'),
    ("gain=2", "gain='2'", 'Argument "gain" to "SunSlew" has incompatible type "str"'),
    ("lambda m: None", "0", 'Argument "reset" to "SunSlew" has incompatible type "int"'),
    ("m.torque)\n", "m.torque, 1)\n", 'Too many arguments for "held" of "Module"'),
    ("I_B=[1, 2, 3], g", "I_B='123', g", 'Argument "I_B" to "Spacecraft" has incompatible type "str"'),
]


@pytest.fixture(scope="module")
def complaints(folder):
    """What mypy says of a mission with each of the mistakes."""
    files = [folder / f"mistake_{k}.py" for k in range(len(MISTAKES))]
    for file, (right, wrong, _) in zip(files, MISTAKES):
        file.write_text(MISSION.replace(right, wrong))
    errors = [line for line in mypy(folder, *files) if ": error: " in line]
    return [[line for line in errors if line.startswith(file.name)] for file in files]


@pytest.mark.long("mypy reads the types of all of Fledge")
@pytest.mark.parametrize("k, right, complaint", [(k, right, text) for k, (right, _, text) in enumerate(MISTAKES)])
def test_mypy_finds_a_mistake_in_a_mission(complaints, k, right, complaint):
    assert MISSION.count(right) == 1
    assert len(complaints[k]) == 1 and complaint in complaints[k][0]


def test_parameters_are_completed_with_unit_rule_and_meaning(folder):
    text = (folder / "stubs/_fledge_flight.pyi").read_text()
    assert "    def __init__(self, *, K: _0, P: _2, K_I: _0 = ..., u_I_max: _0 = ..., hold: _0 = ..., " \
           "update: Callable[[MrpFeedback, float, float], Any] = ..., reset: Callable[[MrpFeedback], Any] = ..., " \
           "turns: int = ...) -> None:\n" \
           '        """K [N m], required, > 0: gain on the MRP error\n' in text
    assert '    K: _Number\n    """[N m], required, > 0: gain on the MRP error"""\n' in text
    project = (folder / "stubs/_project_flight.pyi").read_text()
    assert "from _fledge_flight import BodyTorque\nfrom _fledge_flight import Quality\n" in project
    assert "gain: _0, rates: _2 = ..., least: Quality | int | str = ..., name: str = ..., " in project
    assert "[N m], required, >= 0, <= 8: how 'hard'" in project and "spare" not in project

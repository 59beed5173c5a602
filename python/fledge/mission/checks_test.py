# SPDX-License-Identifier: Apache-2.0
"""Which scenarios can fail by a check; which Python of flight has other bits on a target."""
import importlib
import sys
import textwrap

import pytest

import fledge
from fledge import cli
from fledge.mission.checks import has_checks

SCENARIOS = '''
import numpy as np

from . import help
from .help import settled


def none(sim):
    """It has an array, whose functions raise, and no check."""
    sim.run(np.linalg.norm([1, 0]))


def own(sim):
    sim.run(1)
    assert sim.time == 1, "not 1 s"


def raised(sim):
    sim.run(1)
    if sim.time > 1:
        raise ValueError("more than 1 s")


def numpy(sim):
    sim.run(1)
    np.testing.assert_allclose(sim.time, 1)


def by_name(sim):
    sim.run(1)
    settled(sim)


def by_module(sim):
    none(sim)
    help.settled(sim)


def within(sim):
    def after():
        assert sim.time > 0
    sim.world.at(1, after)
    sim.run(2)


def by_another(sim):
    own(sim)


def by_nothing(sim):
    help.unsettled(sim)
'''
HELP = "def settled(sim):\n    assert sim.time\n\n\ndef unsettled(sim):\n    sim.run(1)\n"


@pytest.fixture(scope="module")
def scenarios(tmp_path_factory):
    folder = tmp_path_factory.mktemp("missions") / "checked"
    folder.mkdir()
    for name, text in (("flight.py", "def build(f):\n    pass\n"), ("scenarios.py", SCENARIOS), ("help.py", HELP)):
        (folder / name).write_text(textwrap.dedent(text))
    return fledge.load(str(folder)).mission.scenarios


@pytest.mark.parametrize("name, expected", [
    ("none", False), ("own", True), ("raised", True), ("numpy", True), ("by_name", True), ("by_module", True),
    ("within", True), ("by_another", True), ("by_nothing", False)])
def test_a_check_is_found_where_the_scenario_reaches_it(scenarios, name, expected):
    assert has_checks(scenarios[name]) is expected


SCRIPT = """\
import math
from math import exp as grow
from fledge import flight as fsw


def begin(m):
    m.reference.sigma_RN[0] = round(0.125, 2)


def far(x):
    return x ** 3 if x > 1 else 2**3 * math.sqrt(x) + round(x) + math.floor(x) + abs(x)


def update(m, t, dt):
    m.reference.sigma_RN[0] = math.sin(t)
    m.reference.sigma_RN[1] = far(t) + grow(t)
    t **= 2
    m.reference.sigma_RN[2] = math.hypot(t, pow(t, 2.0))
    m.publish(m.reference)


def other(x):
    return x ** 2 + math.tan(x)         # composes


def build(f):
    def inner(x):
        return math.log(x)

    f.a = fsw.InertialPointing(update=update, reset=begin, sigma_RN=[other(0.1), 0, 0])
    f.b = fsw.InertialPointing(update=lambda m, t, dt: inner(t))
    f.c = fsw.InertialPointing(sigma_RN=[0.1 ** 2, 0, 0])
    f.task("gnc", every=1, run=[f.a, f.b, f.c])
"""


def refused(folder, capsys):
    """(file, line, reason) of what `fledge check` says of bits."""
    assert cli.main(["check", str(folder)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if " not the same bits under MicroPython: " in line]
    places = [line.partition(": not the same bits under MicroPython: ") for line in lines]
    return [(place.rpartition("/")[2].partition(",")[0], int(place.split()[-1]), why) for place, _, why in places]


def test_what_no_target_has_is_refused_by_line(tmp_path, capsys):
    folder = tmp_path / "bits"
    folder.mkdir()
    (folder / "flight.py").write_text(SCRIPT)
    assert refused(folder, capsys) == [("flight.py", 18, "there is no math.hypot")]
    (folder / "flight.py").write_text(SCRIPT.replace("math.hypot(t, pow(t, 2.0))", "pow(t, 2.0)"))
    assert cli.main(["check", str(folder)]) == 0


SHARED = """\
import math
from math import exp as grow


def shared(x):
    if x > 1:
        return sum([x, grow(x)])
    return x ** 2 + math.sin(x) + math.floor(x) + pow(x, 2)
"""


def test_a_file_of_the_project_that_another_imported_before_is_refused_by_line(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "bits"
    folder.mkdir()
    (tmp_path / "shared_bits.py").write_text(SHARED)
    (folder / "flight.py").write_text("import shared_bits\n" + SCRIPT.replace(
        "math.hypot(t, pow(t, 2.0))", "shared_bits.shared(t)"))
    monkeypatch.setenv("FLEDGE_PROJECT", str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    assert cli.main(["check", str(folder)]) == 0
    del sys.modules["shared_bits"]
    importlib.import_module("shared_bits")
    found = refused(folder, capsys)
    del sys.modules["shared_bits"]
    assert [(file, line, why.split()[0]) for file, line, why in found] == [
        ("shared_bits.py", 7, "math.exp"), ("shared_bits.py", 7, "sum()"), ("shared_bits.py", 8, "**"),
        ("shared_bits.py", 8, "math.sin"), ("shared_bits.py", 8, "pow()")]
    assert "flight's there: flight.py did not import this file, or another file imported it before" in found[0][2]

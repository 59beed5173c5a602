# SPDX-License-Identifier: Apache-2.0
"""Which scenarios can fail by a check."""
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


def test_what_has_other_bits_under_micropython_is_refused_by_line(tmp_path, capsys):
    folder = tmp_path / "bits"
    folder.mkdir()
    (folder / "flight.py").write_text(SCRIPT)
    assert cli.main(["check", str(folder)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if "flight.py, line" in line]
    assert [(int(line.partition(", line ")[2].partition(":")[0]), line.rpartition(": ")[2].split()[0])
            for line in lines] == [
        (7, "round(x,"), (11, "**"), (15, "math.sin"), (16, "math.exp"), (17, "**"), (18, "pow()"),
        (18, "there"), (28, "math.log")]
    assert "the same bits under MicroPython: there is no math.hypot" in lines[6]
    (folder / "flight.py").write_text(SCRIPT.replace("update=update, reset=begin, ", "").replace("inner(t)", "None"))
    assert cli.main(["check", str(folder)]) == 0

# SPDX-License-Identifier: Apache-2.0
"""Which scenarios can fail by a check."""
import textwrap

import pytest

import fledge
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

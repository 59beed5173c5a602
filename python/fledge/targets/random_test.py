# SPDX-License-Identifier: Apache-2.0
"""A few random missions of several flight processes, each process on a target at random, give the desktop's bits.
`./fledge bench flights` flies thousands."""

import os

import pytest

from fledge.targets.linux import Linux
from fledge.targets.testing import fly_mission
from tests.circles import long_after

LONG = os.environ.get("FLEDGE_LONG", "") not in ("", "0")

# Random missions have modules that nothing reads, and rates that are seldom meant.
pytestmark = pytest.mark.filterwarnings("ignore:.*(nothing reads|implausible):UserWarning")


@pytest.mark.long("random missions on all targets")
@pytest.mark.parametrize("number", range(100) if LONG else [3, 22])
def test_a_random_mission_is_the_same_bits_on_targets(number, tmp_path):
    flown, difference = fly_mission(number, tmp_path)
    assert not difference, f"{flown}: {difference}"
    assert int(flown.split()[-2]) > 1000


@pytest.mark.parametrize("number", long_after(1, range(100, 200) if LONG else [31, 8], "more draws"))
def test_a_random_mission_is_composed_and_flown_under_micropython(number, tmp_path):
    flown, difference = fly_mission(number, tmp_path, ["micropython"])
    assert not difference, f"{flown}: {difference}"
    assert int(flown.split()[-2]) > 1000


@pytest.mark.long("random missions on targets")
def test_a_difference_is_seen(tmp_path, monkeypatch):
    """The same mission, but for a seed that one of its processes draws from."""
    build = Linux.build

    def spoiled(self, part):
        for path in part.written:
            if path.name == "random_p0.c":
                text = path.read_text()
                assert "noise00.par.x = " in text
                path.write_text(text.replace("noise00.par.x = ", "noise00.par.x = 1e-9 + "))
        return build(self, part)

    monkeypatch.setattr(Linux, "build", spoiled)
    flown, difference = fly_mission(3, tmp_path, ["linux"])
    assert "p0.noise00.kinds" in difference and "p0=" in flown

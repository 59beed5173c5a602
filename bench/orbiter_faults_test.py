# SPDX-License-Identifier: Apache-2.0
"""The short form of the campaigns of two faults: no run ends in silence, and a run repeats."""
import os

import pytest

from bench import orbiter_faults
from fledge.targets import TARGETS


@pytest.mark.long("a campaign of faults")
@pytest.mark.parametrize("on", ["desktop", "leon3"])
def test_each_run_ends_well_or_says_why(on):
    if on == "leon3" and (TARGETS[on].missing() or os.environ.get("FLEDGE_PRESET", "release") != "release"):
        pytest.skip("the release build shows it, where the compiler for LEON3 is installed")
    start = orbiter_faults.Orbiter(on)
    ends = list(orbiter_faults.study(start, range(4)))
    lines = orbiter_faults.show(ends)
    assert all(end.good or end.reported for end in ends), "\n".join(lines)
    assert len({end.faults for end in ends}) > 1 and len(lines) > sum(not end.good for end in ends)
    assert list(orbiter_faults.study(start, range(3, 4))) == [ends[3]]

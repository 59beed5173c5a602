# SPDX-License-Identifier: Apache-2.0
"""The short form of the campaigns of two faults: no run ends in silence, and a run repeats."""
import os

import pytest

from bench import orbiter_faults
from tests.needs import reason_on, skipped


@pytest.mark.long("a campaign of faults")
@pytest.mark.parametrize("on", ["desktop", pytest.param("leon3", marks=skipped(reason_on("leon3"), (
    "" if os.environ.get("FLEDGE_PRESET", "release") == "release" else "the release build shows it")))])
def test_each_run_ends_well_or_says_why(on):
    start = orbiter_faults.Orbiter(on)
    ends = list(orbiter_faults.study(start, range(4)))
    lines = orbiter_faults.show(ends)
    assert all(end.good or end.reported for end in ends), "\n".join(lines)
    assert len({end.faults for end in ends}) > 1 and len(lines) > sum(not end.good for end in ends)
    assert list(orbiter_faults.study(start, range(3, 4))) == [ends[3]]

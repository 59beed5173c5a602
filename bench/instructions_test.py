# SPDX-License-Identifier: Apache-2.0
"""No part of the world has become slower: its instructions, which the load of the machine does not change."""
import os

import pytest

from bench.instructions import NADIR_SPIN, RECORDED, measured
from tests.needs import needs


@pytest.mark.long("counts the instructions of all cases with valgrind")
@needs("valgrind")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release" or os.uname().machine != "x86_64",
                    reason="the counts are those of the release build for x86-64")
def test_no_case_takes_more_instructions():
    # The counts of other versions of gcc differ by a tenth or so. Who makes a case cheaper records its count anew.
    found = measured()
    assert len(found) > 10 and NADIR_SPIN in found
    more = {name: f"{n:.0f}, recorded are {RECORDED[name]}" for name, n in found.items() if n > 1.25 * RECORDED[name]}
    assert not more

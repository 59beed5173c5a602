# SPDX-License-Identifier: Apache-2.0
"""Every scenario of the mission runs, and its checks pass."""
from pathlib import Path

import pytest

import fledge

FOLDER = Path(__file__).parent


@pytest.mark.parametrize("scenario", fledge.load(FOLDER).scenarios)
def test_the_scenario_passes(scenario):
    sim = fledge.load(FOLDER)
    sim.plots = False
    sim.scenarios[scenario]()

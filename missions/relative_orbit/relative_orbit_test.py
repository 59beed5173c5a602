# SPDX-License-Identifier: Apache-2.0
"""The relative orbit as numbers."""

import numpy as np
import pytest

import fledge
from fledge.units import minute, s


@pytest.mark.parametrize("scenario", ["enter", "blind"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("relative_orbit")
    sim.plots = False
    sim.scenarios[scenario]()


def test_forces_of_the_thrusters_are_what_was_wanted():
    sim = fledge.load("relative_orbit")
    f = sim.flight
    log = sim.record(f.mapping.forces, f.keeping.force, f.mapping.achieved, every=1 * s)
    sim.run(10 * minute)
    given = log["forces.F"] @ f.thrusters.thrusters.axes_B
    wanted = log["keeping.force.force_B"]
    assert np.linalg.norm(wanted, axis=1).max() > 0.1
    np.testing.assert_allclose(given[1:], wanted[1:], atol=1e-9)
    np.testing.assert_allclose(log["achieved.torque_B"], 0, atol=1e-9)

# SPDX-License-Identifier: Apache-2.0
"""The burns as numbers."""

import numpy as np
import pytest

import fledge
from fledge import flight as fsw
from fledge import world
from fledge.units import s
from missions.orbit_raising.world import DRY, FUEL, HIGH, LOW, SLOSH, THRUST


@pytest.mark.parametrize("scenario", ["transfer", "failed_engine"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("orbit_raising")
    sim.plots = False
    sim.scenarios[scenario]()


def test_the_engine_points_along_its_burn():
    sim = fledge.load("orbit_raising")
    log = sim.record(sim.flight.tracking.error, sim.flight.burn.state, every=1 * s)
    sim.run(1310 * s)
    burns = log["state.phase"] == fsw.BurnPhase.RUNS
    off = 4 * np.arctan(np.linalg.norm(log["error.sigma_BR"], axis=1))
    assert 90 < burns.sum() < 110 and off[burns].max() < 0.05


def test_with_a_centre_of_mass_far_beside_the_engine_it_aborts():
    sim = fledge.load("orbit_raising")
    sim.world.craft.center_B = [0.4, 0, 0]      # 40 N m, which the thrusters cannot hold
    sim.run(1300 * s)
    assert sim.flight.burn.state.abort.name == "OFF_POINT"


def test_the_plan_is_hohmanns_transfer():
    """The burns are centred on its ends, and follow the velocity at a circle's rate."""
    mu, a = world.EARTH.mu, (LOW + HIGH) / 2
    rates = np.sqrt(mu / np.array([LOW, HIGH])**3)
    sizes = np.array([np.sqrt(mu / LOW) * (np.sqrt(HIGH / a) - 1), np.sqrt(mu / HIGH) * (1 - np.sqrt(LOW / a))])
    lasts = sizes * (DRY + FUEL + SLOSH) / THRUST
    middle = 1200 + lasts[0] / 2 + np.array([0, np.pi * np.sqrt(a**3 / mu)])
    along = rates[0] * middle[0] + np.array([0, np.pi]) - rates * lasts / 2     # where the craft is as each begins
    plan = fledge.load("orbit_raising").flight.plan
    np.testing.assert_allclose(plan.start, middle - lasts / 2, atol=1e-3)
    np.testing.assert_allclose(plan.dv_N, np.c_[-sizes * np.sin(along), sizes * np.cos(along), [0, 0]], atol=1e-5)
    np.testing.assert_allclose(plan.rate_N, np.c_[[0, 0], [0, 0], rates], atol=1e-9)

# SPDX-License-Identifier: Apache-2.0
"""The safe mode as numbers."""

import numpy as np
import pytest

import fledge
from fledge.attitude import mrp_to_dcm
from fledge.units import minute, s


@pytest.mark.parametrize("scenario", ["safe", "blind"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("sun_safe")
    sim.plots = False
    sim.scenarios[scenario]()


@pytest.mark.parametrize("seed", range(5))
def test_it_finds_the_sun_from_any_tumble(seed):
    random = np.random.default_rng(seed)
    sim = fledge.load("sun_safe", seed=seed)
    sim.world.craft.sigma_BN = random.uniform(-0.5, 0.5, 3)
    sim.world.craft.omega_BN_B = np.radians(random.uniform(-3, 3, 3))
    log = sim.record(sim.world.craft.state, sim.world.light.light, every=1 * s)
    sim.run(6 * minute)
    b1, sun = mrp_to_dcm(log["state.sigma_BN"][-1])[0], log["light.s_N"][-1]
    assert np.degrees(np.arccos(b1 @ sun)) < 4


def test_the_spin_waits_until_the_tumble_has_ended():
    sim = fledge.load("sun_safe")
    log = sim.record(sim.flight.tumble.state, sim.flight.safe.error, every=0.5 * s)
    sim.run(5 * minute)
    tripped = log["state.tripped"] == 1
    calm = log.time[tripped].max()
    spins = np.linalg.norm(log["error.omega_RN_B"], axis=1) > 0
    assert 10 < calm < 180 and not spins[log.time <= calm].any() and spins[log.time > calm + 1].all()

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


def test_a_sun_that_is_said_to_be_good_is_no_false_one():
    """From 40 random starts: two lit sensors alone have two directions that fit."""
    random = np.random.default_rng(39)
    for seed in range(40):
        sim = fledge.load("sun_safe", seed=seed)
        sim.world.craft.sigma_BN = random.uniform(-0.5, 0.5, 3)
        sim.world.craft.omega_BN_B = np.radians(random.uniform(-3, 3, 3))
        line = sim.flight.line
        log = sim.record(sim.world.craft.state, sim.world.light.light, line.heading, line.rate, line.state,
                         every=0.5 * s)
        sim.run(1 * minute)
        good = log["heading.head.quality"] == 3
        assert good[log.time > 10].mean() > 0.9
        sun = np.einsum("ijk,ik->ij", mrp_to_dcm(log["craft.state.sigma_BN"]), log["light.s_N"])
        off = np.linalg.norm(log["heading.s_B"] - sun, axis=1)
        rate = np.linalg.norm(np.cross(log["line.rate.omega_BN_B"] - log["craft.state.omega_BN_B"], sun), axis=1)
        assert (off < 5 * log["line.state.std"])[good].all() and (rate < 6 * log["line.state.rate_std"])[good].all()


def test_the_spin_waits_until_the_tumble_has_ended():
    sim = fledge.load("sun_safe")
    log = sim.record(sim.flight.tumble.state, sim.flight.safe.error, every=0.5 * s)
    sim.run(5 * minute)
    tripped = log["state.tripped"] == 1
    calm = log.time[tripped].max()
    spins = np.linalg.norm(log["error.omega_RN_B"], axis=1) > 0
    assert 10 < calm < 180 and not spins[log.time <= calm].any() and spins[log.time > calm + 1].all()

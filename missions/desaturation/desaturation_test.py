# SPDX-License-Identifier: Apache-2.0
"""Desaturation as numbers."""

import numpy as np
import pytest

import fledge
from fledge.units import minute, s


@pytest.mark.parametrize("scenario", ["rods", "thrusters"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("desaturation")
    sim.plots = False
    sim.scenarios[scenario]()


def test_the_rods_give_what_flight_believes():
    sim = fledge.load("desaturation")
    log = sim.record(sim.flight.magnetic.achieved, sim.world.rods.torque, every=0.5 * s)
    sim.run(10 * minute)
    believed, true = log["achieved.torque_B"][1:-1], log["torque.torque_B"][2:]
    assert np.linalg.norm(true, axis=1).max() > 1e-3
    # The magnetometer's bias, its noise, and how far the field turns in half a second.
    assert np.abs(believed - true).max() < 0.02 * np.abs(true).max()


def test_without_them_the_momentum_stays():
    sim = fledge.load("desaturation")
    sim.flight.surplus.gain = sim.flight.excess.gain = 1e-12
    sim.plots = False
    with pytest.raises(AssertionError, match="are left of"):
        sim.scenarios["rods"]()


def test_a_clone_uses_its_own_field():
    sim = fledge.load("desaturation")
    other = sim.clone()
    assert other.world.rods.field is other.world.field and sim.world.rods.field is sim.world.field
    for flown in (sim, other):
        flown.run(10 * s)
    assert (sim.world.rods.torque.torque_B == other.world.rods.torque.torque_B).all()

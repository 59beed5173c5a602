# SPDX-License-Identifier: Apache-2.0
"""The telescope's slew as numbers, by both filters."""

import numpy as np
import pytest

import fledge
from fledge.units import kg, m, minute, ms, s
from missions.star_slew.scenarios import _shaking
from missions.star_slew.world import DYNAMIC, OWN, STATIC


@pytest.mark.parametrize("filter", ["AttitudeMekf", "AttitudeUkf"])
@pytest.mark.parametrize("scenario", ["slew", "faults"])
def test_the_scenarios_pass(scenario, filter):
    sim = fledge.load("star_slew", filter=filter)
    sim.plots = False
    sim.scenarios[scenario]()


def test_the_bias_of_the_gyro_is_found():
    sim = fledge.load("star_slew")
    sim.run(10 * minute)
    state, gyro = sim.flight.filter.state, sim.world.gyro
    off = state.bias_B - (np.array(gyro.bias) + gyro.walked)
    assert np.linalg.norm(gyro.bias) > 1e-4 and (np.abs(off) < 5 * state.bias_std).all()
    assert state.bias_std.max() < 2e-6


def test_both_filters_estimate_the_same():
    ends = []
    for filter in ("AttitudeMekf", "AttitudeUkf"):
        sim = fledge.load("star_slew", filter=filter)
        log = sim.record(sim.flight.filter.attitude, sim.flight.filter.state, every=10 * s)
        sim.run(4 * minute)
        ends.append((log["attitude.sigma_BN"][3:], log["state.attitude_std"][3:]))
    (a, std), (b, _) = ends     # the loop is closed, so that the attitudes differ by a little more than the filters
    assert np.abs(4 * (a - b)).max() < 0.1 * std.max()


def test_late_attitudes_are_used_at_their_time():
    sim = fledge.load("star_slew")
    log = sim.record(sim.world.stars.attitude, sim.world.craft.state, every=1 * s)
    sim.run(1 * minute)
    assert set(log["attitude.head.t"][2:] % 1_000_000_000) == {0}
    assert sim.flight.filter.state.late == 0 and sim.flight.filter.state.used > 55


def test_the_wheels_alone_shake_the_telescope_in_an_exposure():
    sim = fledge.load("star_slew")
    sim.plots = False
    sim.world.wheels.unbalance = sim.world.wheels.couple = [0] * 4
    with pytest.raises(AssertionError, match="the wheels shake"):
        sim.scenarios["exposure"]()


@pytest.mark.parametrize("wheel", [0, 2])
def test_a_wheel_shakes_body_and_panels_as_free_bodies(wheel):
    """Far above the panels' frequency: by the matrix of all masses, less what swings about the hinges."""
    sim = fledge.load("star_slew")
    sim.plots = False
    wheels = sim.world.wheels
    for imbalance in (wheels.unbalance, wheels.couple):
        imbalance[:] = [value if i == wheel else 0 for i, value in enumerate(imbalance)]
    log = sim.record(sim.world.craft.state, wheels.speeds, every=4 * ms)
    sim.run(1 * minute)
    speed = log["speeds.Omega"][-250:, wheel].mean()
    found = np.sqrt(2 * (_shaking(log)**2).mean(axis=0).sum())

    mass, inertia = np.eye(6) * 310, np.diag([68.0, 70, 120])
    mass[3:, 3:] = inertia
    for side in (1, -1):
        hinge, arm, axis = np.array([0, 0.7 * side, 0]), np.array([0, 1.0 * side, 0]), np.array([1.0 * side, 0, 0])
        c = hinge + arm
        push, turn = 5 * np.cross(axis, arm), OWN @ axis + np.cross(c, 5 * np.cross(axis, arm))
        mass[3:, 3:] += OWN + 5 * (c @ c * np.eye(3) - np.outer(c, c))
        both = np.concatenate([push, turn])
        mass -= np.outer(both, both) / (axis @ OWN @ axis + 5 * arm @ arm)
    g = wheels.axes_B[wheel] / np.linalg.norm(wheels.axes_B[wheel])
    u = np.cross(g, [1, 0, 0]) / np.linalg.norm(np.cross(g, [1, 0, 0]))
    turns = u + 1j * np.cross(g, u)                 # its direction, a quarter of a turn later the imaginary one
    force, couple = STATIC.to(kg * m) * turns, DYNAMIC.to(kg * m**2) * turns
    load = np.concatenate([force, np.cross(wheels.r_WB_B[wheel], force) + couple])
    expected = np.linalg.norm(np.linalg.solve(mass, load)[3:])
    assert 80 < abs(speed) < 130 and abs(found / expected - 1) < 0.03

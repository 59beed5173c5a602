# SPDX-License-Identifier: Apache-2.0
"""The rectangular raster as numbers: where b1 looks, from the truth alone."""

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge.units import deg, s


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("rectangular_raster")
    sim.plots = False
    log = sim.record(sim.world.craft.state, sim.flight.motor.command, sim.world.wheels.speeds, every=1 * s)
    sim.scenarios["raster"]()
    r, v = log["state.r_BN_N"], log["state.v_BN_N"]
    down = -r / np.linalg.norm(r, axis=1, keepdims=True)
    normal = np.cross(r, v)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    b1 = attitude.mrp_to_dcm(log["state.sigma_BN"])[:, 0]
    # Yaw turns nadir about the orbit's normal, pitch tips it towards the normal's other side; as the
    # frame that is turned looks up, b1 moves as its opposite.
    along, across = np.cross(normal, down), normal
    yaw = np.degrees(np.arctan2(np.sum(b1 * along, axis=1), np.sum(b1 * down, axis=1)))
    pitch = np.degrees(np.arcsin(np.sum(b1 * across, axis=1)))
    return log, yaw, pitch


@pytest.mark.parametrize("pass_start", [0, 4800])
def test_five_lines_across_the_swath(flown, pass_start):
    log, yaw, pitch = flown
    for number, height in enumerate([6, 3, 0, -3, -6]):
        start = pass_start + 200 + 900 * number
        line = slice(start + 100, start + 701)  # the swath: 6 deg to either side, at 0.02 deg/s
        way = 1 if number % 2 else -1
        np.testing.assert_allclose(yaw[line], way * np.linspace(-6, 6, 601), atol=0.15)
        np.testing.assert_allclose(pitch[line], height, atol=0.13)
        assert abs(yaw[line] - way * np.linspace(-6, 6, 601))[300:].max() < 1e-3
        assert abs(pitch[line] - height)[300:].max() < 1e-3


def test_it_is_flown_through_periapsis_within_limits(flown):
    log, *_ = flown
    radius = np.linalg.norm(log["state.r_BN_N"], axis=1)
    assert 1800 < log.time[radius.argmin()] < 3600
    assert np.abs(log["command.u"]).max() < 0.1 and np.abs(log["speeds.Omega"]).max() < 10


def test_another_list_takes_over_while_it_flies():
    sim = fledge.load("rectangular_raster")
    log = sim.record(sim.flight.rasters.command, sim.flight.rasters.status, every=0.5 * s)
    sim.run(60 * s)
    ground = sim.flight.rasters.list
    ground.start, ground.n = 70.3 * s, 2
    ground.angles, ground.durations = [[0, 0, 0], [1, 2, 0]] * deg, [5, 7] * s
    ground.head.quality = "GOOD"
    sim.run(30 * s)
    # From the first update at or after each instant on, with the instant itself as the start; the end is held.
    assert np.unique(log["command.start"]).tolist() == [0, 70_300_000_000, 75_300_000_000, 82_300_000_000]
    changes = log.time[1:][np.diff(log["command.start"]) > 0]
    assert changes.tolist() == [70.5, 75.5, 82.5]
    assert log["status.done"][-1] == 1
    np.testing.assert_allclose(log["command.angles"][-1], np.radians([1, 2, 0]), atol=1e-16)

    ground.start, ground.durations[0] = 95 * s, -5
    sim.run(10 * s)     # refused; what was goes on
    assert sim.flight.rasters.status.refused == 1 and log["command.start"][-1] == 82_300_000_000


@pytest.mark.long("draws all figures")
def test_it_draws_its_figures(tmp_path):
    from fledge.cli import main

    assert main(["run", "rectangular_raster", "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("rectangular_raster_*.png"))) == 3

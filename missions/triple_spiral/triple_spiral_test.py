# SPDX-License-Identifier: Apache-2.0
"""The three spirals as numbers: figure 2.16 of the thesis."""

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge.units import s

CENTRES = np.radians([[-7, -4], [7, -4], [0, 8]])  # yaw, pitch


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("triple_spiral")
    sim.plots = False
    log = sim.record(sim.world.craft.state, sim.flight.motor.command, every=1 * s)
    sim.scenarios["spirals"]()
    return log, attitude.mrp_to_dcm(log["state.sigma_BN"])[:, 0]


@pytest.mark.parametrize("k", range(3))
def test_each_is_a_spiral_about_its_own_centre(flown, k):
    log, b1 = flown
    yaw, pitch = CENTRES[k]
    centre = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)])
    start = 3000 * k + 300
    assert np.degrees(np.arccos(b1[start - 1] @ centre)) < 0.05  # it has come to rest there
    drawn = slice(start + 300, start + 2700)
    since = log.time[drawn] - start
    np.testing.assert_allclose(np.degrees(np.arccos(b1[drawn] @ centre)), 6 * since / 2700, atol=5e-4)
    across = np.cross([0, 0, 1], centre)
    across /= np.linalg.norm(across)
    turned = np.unwrap(np.arctan2(b1[drawn] @ np.cross(centre, across), b1[drawn] @ across))
    assert np.degrees(turned[-1] - turned[0]) == pytest.approx(0.4 * 2399, abs=0.05)


def test_they_stay_apart_and_it_returns_to_the_middle(flown):
    log, b1 = flown
    yaw, pitch = CENTRES.T
    centres = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)], axis=-1)
    for k in range(3):
        others = np.delete(centres, k, axis=0)
        drawn = b1[3000 * k + 300:3000 * k + 3000]
        assert np.degrees(np.arccos(drawn @ others.T)).min() > 7.5
    assert np.degrees(np.hypot(b1[-1, 1], b1[-1, 2])) < 1e-3
    assert np.abs(log["command.u"]).max() < 0.2 + 1e-12


def test_it_draws_its_figures(tmp_path):
    from fledge.cli import main

    assert main(["run", "triple_spiral", "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("triple_spiral_*.png"))) == 3

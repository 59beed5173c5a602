# SPDX-License-Identifier: Apache-2.0
"""The spiral as numbers: figures 2.14 and 2.15 of the thesis."""

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge.units import s


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("single_spiral")
    sim.plots = False
    log = sim.record(sim.world.craft.state, sim.flight.tracking.error, sim.flight.motor.command, every=1 * s)
    sim.scenarios["spiral"]()
    return log, attitude.mrp_to_dcm(log["state.sigma_BN"])[:, 0]


def test_the_boresight_draws_a_spiral_of_archimedes(flown):
    log, b1 = flown
    drawn = slice(600, 4801)
    t = log.time[drawn]
    # In the plane across the centre: as far out as the pitch, towards -r3 turned by the roll.
    np.testing.assert_allclose(np.degrees(np.arccos(b1[drawn, 0])), 0.0025 * t, atol=1e-5)
    turned = np.degrees(np.unwrap(np.arctan2(b1[drawn, 2], b1[drawn, 1])))
    np.testing.assert_allclose(turned - turned[0], 0.3 * (t - t[0]), atol=1e-4)
    assert turned[0] == pytest.approx(-90 + 180, abs=1e-4)  # half a turn after 600 s


def test_it_returns_to_its_centre_and_rests(flown):
    log, b1 = flown
    off = np.degrees(np.hypot(b1[:, 1], b1[:, 2]))
    assert off[4800] == pytest.approx(np.degrees(np.sin(np.radians(12))), abs=1e-6)
    # Smoothly: it nears the centre and stays within reach of it.
    assert (np.diff(off[4810:5100]) < 0).all() and off[5200:].max() < 1e-2 and off[-1] < 1e-9
    np.testing.assert_allclose(log.last("state.sigma_BN"), 0, atol=1e-12)


def test_two_peaks_and_small_torques_between(flown):
    log, _ = flown
    error = np.linalg.norm(log["error.sigma_BR"], axis=1)
    torque = np.abs(log["command.u"]).max(axis=1)
    assert torque[:60].max() > 0.1 and torque[4801:4860].max() > 0.1 and torque.max() < 0.2 + 1e-12
    for quiet in (slice(600, 4801), slice(5400, None)):
        assert error[quiet].max() < 1e-5 and torque[quiet].max() < 1e-4


@pytest.mark.long("draws all figures")
def test_it_draws_its_figures(tmp_path):
    from fledge.cli import main

    assert main(["run", "single_spiral", "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("single_spiral_*.png"))) == 3

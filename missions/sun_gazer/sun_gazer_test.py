# SPDX-License-Identifier: Apache-2.0
"""The solar telescope as numbers."""

import numpy as np
import pytest

import fledge
from fledge.units import N, m, minute, s


@pytest.mark.parametrize("scenario", ["acquire", "turn", "leak"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("sun_gazer")
    sim.plots = False
    sim.scenarios[scenario]()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("dead", [[], [{"kind": "DEAD", "channels": 1 << 9}]], ids=["four", "three"])
def test_it_finds_the_sun_from_any_tumble_by_four_gyros_or_three(seed, dead):
    """A gimbal whose motor is dead follows no command; its wheel turns on."""
    random = np.random.default_rng(seed)
    sim = fledge.load("sun_gazer", seed=seed)
    w = sim.world
    w.craft.sigma_BN, w.craft.omega_BN_B = random.uniform(-0.5, 0.5, 3), np.radians(random.uniform(-3, 3, 3))
    w.gyros.faults = dead
    log = sim.record(w.eye.heading, every=1 * s)
    sim.run(8 * minute)
    assert np.arccos(min(1, log["heading.s_B"][-60:, 0].min())) < 5e-3


def test_the_rates_give_the_torque_that_control_wants():
    """On the body acts what the gyros lose: dh/dt + omega x h = -L, with the momentum h of their wheels."""
    sim = fledge.load("sun_gazer")
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.gyros.gimbals, f.control.torque, every=0.2 * s)
    sim.run(60 * s)
    g, s0 = (axes / np.linalg.norm(axes, axis=1)[:, None] for axes in
             (w.gyros.gimbal_axes_B[:4], w.gyros.spin_axes_B[:4]))
    angle = log["gimbals.angle"][:, :4, None]
    h = 6 * (s0 * np.cos(angle) + np.cross(g, s0) * np.sin(angle)).sum(axis=1)
    given = -(np.diff(h, axis=0) / 0.2 + np.cross(log["craft.state.omega_BN_B"], h)[1:])[1:]
    wanted, new = log["control.torque.torque_B"], 1 - 0.5 * (1 - np.exp(-2))     # the gimbals' lag is half an update
    off = np.linalg.norm(given - new * wanted[1:-1] - (1 - new) * wanted[:-2], axis=1)
    wanted = np.linalg.norm(wanted[1:-1], axis=1)
    assert wanted.max() > 3 and (off < 0.1 * wanted + 5e-3).all()


def test_a_torque_from_outside_shows_in_the_momentum():
    sim = fledge.load("sun_gazer")
    sim.plots = False
    acts = sim.world.leak.external
    acts.torque_B, acts.head.quality = [0, 0, 1e-6] * N * m, "GOOD"
    with pytest.raises(AssertionError, match="momentum came from nowhere"):
        sim.scenarios["acquire"]()

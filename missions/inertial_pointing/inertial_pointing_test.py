# SPDX-License-Identifier: Apache-2.0
"""The mission as numbers: what figures 3.3 and 3.4 show, and what physics demands besides."""

import numpy as np
import pytest

import fledge
from fledge import attitude, cosim
from fledge.units import minute, s


@pytest.fixture(scope="module", params=[0, 1], ids=["latency 0", "latency 1"])
def flown(request):
    sim = fledge.load("inertial_pointing", latency=request.param)
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.wheels.speeds, f.tracking.error, f.motor.command, every=1 * s)
    sim.run(40 * minute)
    return sim, log


def _wheels_momentum(sim, log):
    """(n, 3), in B [N m s]."""
    axes, J = sim.world.wheels.axes_B, sim.world.wheels.J
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return (J * (log["speeds.Omega"][:, :4] + log["state.omega_BN_B"] @ axes.T)) @ axes


@pytest.mark.parametrize("latency", [0, 1])
def test_the_scenario_passes(latency):
    sim = fledge.load("inertial_pointing", latency=latency)
    sim.plots = False
    sim.scenarios["detumble"]()


def test_it_tumbles_and_comes_to_rest(flown):
    _, log = flown
    error, rate = (np.linalg.norm(log[name], axis=1) for name in ("error.sigma_BR", "state.omega_BN_B"))
    assert rate[0] > 0.03 and np.linalg.norm(log["state.sigma_BN"][0]) > 0.3
    assert error[log.time > 20 * 60].max() < 1e-6 and rate[log.time > 20 * 60].max() < 1e-7
    assert error[-1] < 1e-11 and rate[-1] < 1e-12, "the error falls to zero, because nothing disturbs the body at rest"


def test_the_slowest_mode_is_that_of_the_gains(flown):
    # Near rest, sigma' = omega / 4 and I omega' = -K sigma - P omega + h x omega: the momentum h in the wheels,
    # which flight does not know, couples the axes.
    sim, log = flown
    h, I = _wheels_momentum(sim, log)[-1], np.diag([700.0, 700.0, 800.0])
    turn = np.cross(h, np.eye(3)).T
    near_rest = np.block([[np.zeros((3, 3)), np.eye(3) / 4],
                          [-2.531 * np.linalg.inv(I), np.linalg.inv(I) @ (turn - 45 * np.eye(3))]])
    during = (log.time > 1000) & (log.time < 2200)
    error = np.log(np.linalg.norm(log["error.sigma_BR"][during], axis=1))
    slope = np.polyfit(log.time[during], error, 1)[0]
    # A command that is held, and with latency 1 late, moves the slow root little.
    assert slope == pytest.approx(np.linalg.eigvals(near_rest).real.max(), rel=0.02)


def test_torques_saturate_at_first_only_and_vanish(flown):
    _, log = flown
    largest = np.abs(log["command.u"]).max(axis=1)
    saturated = log.time[largest >= 0.2 * (1 - 1e-12)]
    assert np.nanmax(largest) < 0.2 * (1 + 1e-12) and 10 < len(saturated) and saturated.max() < 80
    assert largest[-1] < 1e-10


def test_the_wheels_hold_what_the_body_turned_with(flown):
    sim, log = flown
    c_BN, omega, wheels = attitude.mrp_to_dcm(log["state.sigma_BN"]), log["state.omega_BN_B"], _wheels_momentum(*flown)
    H_N = np.einsum("nji,nj->ni", c_BN, omega @ sim.world.craft.I_B.T + wheels)
    np.testing.assert_allclose(H_N, np.broadcast_to(H_N[0], H_N.shape), atol=1e-8 * np.linalg.norm(H_N[0]))
    np.testing.assert_allclose(wheels[-1], H_N[0], atol=1e-8)


def test_two_messages_cross_as_in_the_thesis():
    for latency, names in ((0, ["same_instant", "next_instant"]), (1, ["next_exchange"] * 2)):
        wires = cosim.crossing_wires(fledge.load("inertial_pointing", latency=latency))
        assert [w.topic for w in wires] == ["/world/nav/attitude", "/flight/motor/command"]
        assert [w.latency for w in wires] == names

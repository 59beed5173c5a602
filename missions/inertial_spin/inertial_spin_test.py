# SPDX-License-Identifier: Apache-2.0
"""The mission as numbers: what physics demands of a spin about an axis at rest."""

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge.units import deg, minute, s


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("inertial_spin")
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.wheels.speeds, f.spin.reference, f.tracking.error, f.motor.command, every=1 * s)
    sim.run(40 * minute)
    return sim, log


def test_the_scenario_passes():
    sim = fledge.load("inertial_spin")
    sim.plots = False
    sim.scenarios["spin"]()


def test_the_scenario_notices_another_rate():
    sim = fledge.load("inertial_spin")
    sim.plots = False
    sim.flight.spin.omega_RR0_R0 = [0, 0, 0.301] * deg / s
    with pytest.raises(AssertionError, match="another rate"):
        sim.scenarios["spin"]()


def test_it_has_the_seven_modules_of_the_thesis():
    names = ["vehicle", "wheels", "guidance", "spin", "tracking", "control", "motor"]
    assert list(fledge.load("inertial_spin").flight.instances) == names


def test_the_body_spins_about_an_axis_at_rest(flown):
    sim, log = flown
    late = log.time > 20 * 60
    C_BN = attitude.mrp_to_dcm(log["state.sigma_BN"][late])
    base = attitude.mrp_to_dcm(sim.flight.guidance.sigma_RN)
    np.testing.assert_allclose(C_BN[:, 2], np.broadcast_to(base[2], (len(C_BN), 3)), atol=4e-4)
    b1 = C_BN[:, 0] @ base.T
    heading = np.unwrap(np.arctan2(b1[:, 1], b1[:, 0]))
    slope = np.polyfit(log.time[late], heading, 1)[0]
    assert np.degrees(slope) == pytest.approx(0.3, abs=1e-5)


def test_the_torques_turn_with_the_body(flown):
    # The wheels hold the momentum H_N - I omega, which rests in N; in B it turns by -omega, which takes the torque
    # omega x h.
    sim, log = flown
    axes, J = sim.world.wheels.axes_B, sim.world.wheels.J
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    omega = log["state.omega_BN_B"]
    h = (J * (log["speeds.Omega"][:, :4] + omega @ axes.T)) @ axes
    torque = log["command.u"][:, :4] @ axes     # on the wheels
    late = log.time > 30 * 60
    np.testing.assert_allclose(torque[late], -np.cross(omega, h)[late], atol=2e-4)
    assert np.linalg.norm(torque[late], axis=1).min() > 0.01    # it is no free motion

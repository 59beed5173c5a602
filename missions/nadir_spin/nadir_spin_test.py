# SPDX-License-Identifier: Apache-2.0
"""The mission as numbers: what the thesis' figure 2.9 shows, and what physics demands besides."""

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge.units import minute, s


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("nadir_spin")
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.wheels.speeds, f.tracking.error, f.motor.command, f.guidance.reference,
                     f.spin.reference, every=1 * s)
    sim.run(160 * minute)
    return sim, log


def test_the_scenario_passes():
    sim = fledge.load("nadir_spin")
    sim.plots = False
    sim.scenarios["spin"]()


def test_the_error_converges(flown):
    _, log = flown
    error = np.linalg.norm(log["error.sigma_BR"], axis=1)
    assert error[0] > 0.5
    assert error[log.time > 40 * 60].max() < 1e-4
    assert np.linalg.norm(log["error.omega_BR_B"], axis=1)[log.time > 40 * 60].max() < 1e-5


def test_torques_saturate_at_first_only(flown):
    _, log = flown
    largest = np.abs(log["command.u"]).max(axis=1)
    saturated = log.time[largest >= 0.2 * (1 - 1e-12)]
    assert largest.max() < 0.2 * (1 + 1e-12) and 0 < len(saturated) and saturated.max() < 150
    assert largest[log.time > 1000].max() < 0.1
    assert largest[log.time > 1000].min() > 0.01  # it is no free motion


def test_the_boresight_stays_on_nadir_through_periapsis(flown):
    _, log = flown
    down = -log["state.r_BN_N"] / np.linalg.norm(log["state.r_BN_N"], axis=1, keepdims=True)
    b1 = attitude.mrp_to_dcm(log["state.sigma_BN"])[:, 0]
    off = np.linalg.norm(np.cross(b1, down), axis=1)
    radius = np.linalg.norm(log["state.r_BN_N"], axis=1)
    periapsis = log.time[radius.argmin()]
    assert radius.min() == pytest.approx(7471.618e3 * 0.6, rel=1e-6) and 1800 < periapsis < 3600
    assert off[log.time > 40 * 60].max() < 4e-4 and np.einsum("ij,ij->i", b1, down)[-1] > 0


def test_the_body_turns_about_nadir_at_the_given_rate(flown):
    # In the Hill frame, b2 turns about the radial axis by 0.3 deg/s; the sense is that of +r, which is -b1.
    _, log = flown
    late = log.time > 60 * 60
    hill = attitude.mrp_to_dcm(log["guidance.reference.sigma_RN"][late])
    body = attitude.mrp_to_dcm(log["state.sigma_BN"][late])
    b2 = np.einsum("nij,nj->ni", hill, body[:, 1])
    turned = np.unwrap(np.arctan2(b2[:, 2], b2[:, 1]))
    rate = (turned[-1] - turned[0]) / (log.time[late][-1] - log.time[late][0])
    assert np.degrees(rate) == pytest.approx(0.3, abs=1e-5)
    assert np.abs(b2[:, 0]).max() < 4e-4


def test_momentum_and_energy_are_kept(flown):
    sim, log = flown
    c_BN = attitude.mrp_to_dcm(log["state.sigma_BN"])
    axes, J = sim.world.wheels.axes_B, sim.world.wheels.J
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    omega = log["state.omega_BN_B"]
    body = omega @ sim.world.craft.I_B.T  # without the wheels about their axes
    wheels = (J * (log["speeds.Omega"][:, :4] + omega @ axes.T)) @ axes
    H_N = np.einsum("nji,nj->ni", c_BN, body + wheels)
    np.testing.assert_allclose(H_N, np.broadcast_to(H_N[0], H_N.shape), atol=1e-8 * np.linalg.norm(H_N[0]))
    r, v = log["state.r_BN_N"], log["state.v_BN_N"]
    energy = 0.5 * np.sum(v * v, axis=1) - sim.world.craft.gravity[0].mu / np.linalg.norm(r, axis=1)
    assert np.ptp(energy) < 1e-10 * abs(energy[0])


def test_the_same_seed_gives_the_same_archive(tmp_path):
    files = []
    for i in range(2):
        sim = fledge.load("nadir_spin", seed=5)
        sim.world.nav.rate_noise = [1e-5] * 3
        sim.record(sim.flight.tracking.error, sim.world.nav.attitude, every=10 * s)
        sim.archive(tmp_path / f"{i}.mcap")
        sim.run(10 * minute)
        files.append(open(sim.close_archive(), "rb").read())
    assert files[0] == files[1] and len(files[0]) > 10_000


def test_without_the_wheels_momentum_it_does_not_settle():
    sim = fledge.load("nadir_spin")
    sim.flight.wheels.J = 1e-9  # flight believes in wheels without inertia
    sim.run(160 * minute)
    assert np.linalg.norm(sim.flight.tracking.error.sigma_BR) > 1e-2

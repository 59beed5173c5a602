# SPDX-License-Identifier: Apache-2.0
"""The fly-by as numbers: the velocity frame from the truth, and the way against an integration of its own."""

import numpy as np
import pytest

import fledge
from fledge import Orbit, attitude, world
from fledge.units import km, s


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("flyby")
    sim.plots = False
    log = sim.record(sim.world.craft.state, sim.world.wheels.speeds, every=1 * s)
    sim.scenarios["flyby"]()
    return sim, log


def test_the_body_stands_in_the_velocity_frame(flown):
    _, log = flown
    late = log.time > 20 * 60
    r, v = log["state.r_BN_N"][late], log["state.v_BN_N"][late]
    r2 = v / np.linalg.norm(v, axis=1, keepdims=True)
    r3 = np.cross(r, v)
    r3 /= np.linalg.norm(r3, axis=1, keepdims=True)
    frame = np.stack([np.cross(r2, r3), r2, r3], axis=1)
    apart = attitude.mrp_to_dcm(log["state.sigma_BN"][late]) @ np.swapaxes(frame, 1, 2)
    assert np.abs(attitude.dcm_to_prv(apart)).max() < 5e-6
    assert (np.sum(frame[:, 0] * r, axis=1)[log.time[late] > 4800] > 0).all()  # r1 looks outward


def test_the_wheels_keep_within_what_such_wheels_do(flown):
    _, log = flown
    assert np.abs(log["speeds.Omega"]).max() < 200  # [rad/s], most of it from the tumble


def test_sun_and_jupiter_bend_the_way_as_an_integration_in_python_says(flown):
    sim, log = flown
    sky, start = sim.world.craft.sky, sim.world.craft
    pulls = [(body.mu, body) for body in (world.SUN, world.JUPITER_SYSTEM)]
    # Their way in a minute is short: a parabola through three instants serves for the run.
    nodes = np.array([0, 4800, 9600.0])
    ways = [(mu, np.polyfit(nodes, [sky.state(body, t).r_PN_N for t in nodes], 2)) for mu, body in pulls]

    def derive(t, y, with_pulls):
        a = -start.gravity[0].mu * y[:3] / np.dot(y[:3], y[:3])**1.5
        for mu, way in ways if with_pulls else ():
            d = (way[0] * t + way[1]) * t + way[2]
            a = a + mu * ((d - y[:3]) / np.dot(d - y[:3], d - y[:3])**1.5 - d / np.dot(d, d)**1.5)
        return np.concatenate([y[3:], a])

    def integrate(with_pulls, h=5.0):
        y, t = np.concatenate([start.r_BN_N, start.v_BN_N]), 0.0
        while t < 9600:
            k1 = derive(t, y, with_pulls)
            k2 = derive(t + h / 2, y + h / 2 * k1, with_pulls)
            k3 = derive(t + h / 2, y + h / 2 * k2, with_pulls)
            k4 = derive(t + h, y + h * k3, with_pulls)
            y, t = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
        return y

    there = log["state.r_BN_N"][-1]
    pulled, alone = integrate(True), integrate(False)
    assert np.linalg.norm(pulled[:3] - there) < 0.01
    assert 5 < np.linalg.norm(alone[:3] - there) < 20


def test_mars_turns_the_velocity_by_what_the_hyperbola_says(flown):
    sim, log = flown
    r, v = log["state.r_BN_N"], log["state.v_BN_N"]
    first, last = (Orbit.from_state(sim.world.craft.gravity[0], r[k], v[k]) for k in (0, -1))
    assert first.e == pytest.approx(1.8, abs=1e-12) and last.e == pytest.approx(1.8, abs=1e-4)
    assert last.p / (1 + last.e) == pytest.approx((3897 * km).value, abs=100)
    # The velocity turns by what the position sweeps, less the change of the flight path angle.
    e, f = 1.8, np.radians(103.8)
    path = np.arctan2(e * np.sin(f), 1 + e * np.cos(f))
    turned = np.arccos(np.dot(v[0], v[-1]) / np.linalg.norm(v[0]) / np.linalg.norm(v[-1]))
    assert turned == pytest.approx(2 * f - 2 * path, abs=1e-3) and turned > np.radians(50)


@pytest.mark.long("draws all figures")
def test_it_draws_its_figures(tmp_path):
    from fledge.cli import main

    assert main(["run", "flyby", "--out", str(tmp_path)]) == 0
    assert sorted(p.stem for p in tmp_path.glob("*.png")) == ["flyby_errors", "flyby_sphere", "flyby_trajectory"]

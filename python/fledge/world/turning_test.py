# SPDX-License-Identifier: Apache-2.0
"""Ground targets of flight that turn as fitted, against the Sky that they come from."""

import numpy as np
import pytest

from fledge import SetupError, Simulation, flight as fsw, world
from fledge.units import day, deg, hour, m, minute, s
from tests.needs import module, needs

pytestmark = needs("casacore-data-jpl-de405")
PLACES = [(1.44, 43.6), (-120.0, -5.0), (80.0, 88.0)]


def sky_of(body):
    earth = world.EarthOrientation(ut1_tai=-37) if body is world.EARTH else None
    return world.Sky("2026-03-20T10:00:00", center=body, earth=earth)


@pytest.mark.parametrize("body, within, start, duration", [
    (world.EARTH, 2.4 * m, 0 * s, 2 * day), (world.EARTH, 25 * m, 0 * s, 30 * day),
    (world.MARS, 0.4 * m, 3 * hour, 5 * day), (world.MOON, 11 * m, 0 * s, 2 * hour)])
def test_places_are_within_the_bound_over_the_whole_span(body, within, start, duration):
    sky = sky_of(body)
    fit = world.fit_orientation(sky, body, within=within, start=start, duration=duration)
    assert np.linalg.norm(fit["dcm_PN"] @ fit["dcm_PN"].T - np.eye(3)) < 1e-14
    sim = Simulation("ground")
    f, w = sim.flight, sim.world
    w.craft, w.nav = world.Spacecraft(I_B=1), world.Navigation()
    w.connect(w.craft.state >> w.nav.truth)
    for i, (longitude, latitude) in enumerate(PLACES):
        target = fsw.GroundTarget(longitude=longitude * deg, latitude=latitude * deg, radius=body.radius * m, **fit)
        setattr(f, f"place_{i}", target)
        w.connect(w.nav.orbit >> target.orbit)
    f.task("flight", every=duration / 97, run=[*f])
    w.task("world", every=duration / 97, run=[w.craft, w.nav])
    log = sim.record(*(target_.target for target_ in f), every=duration / 97)
    sim.run(start + duration)
    t = log.time[log.time >= float(start / s)]
    axes = np.array([sky.orientation(body, now).dcm_PN for now in t])
    off = []
    for i, (longitude, latitude) in enumerate(np.radians(PLACES)):
        r_P = body.radius * np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
                                      np.sin(latitude)])
        off += [np.linalg.norm(log[f"place_{i}.target.r_PN_N"][-len(t):] - r_P @ axes, axis=1)]
    assert 0.5 * float(within / m) < np.max(off) < float(within / m)


def test_attitude_and_rate_are_those_of_more_digits():
    """Against the same least squares by singular values, in 40 digits."""
    mp = module("mpmath").mp
    sky, span = sky_of(world.MARS), 3 * 86400 * 10**9
    fit = world.fit_orientation(sky, world.MARS, within=1 * m, duration=3 * day)
    times = [round(k * span / 64) / 1e9 for k in range(65)]
    with mp.workdps(40):
        truth = [mp.matrix(sky.orientation(world.MARS, t).dcm_PN.tolist()) for t in times]

        def turn(angle):
            c, s = mp.cos(angle), mp.sin(angle)
            return mp.matrix([[c, s, 0], [-s, c, 0], [0, 0, 1]])

        rate, middle = mp.mpf(fit["rate"]), mp.mpf(span) / 2 / 10**9
        for _ in range(4):
            total = sum((turn(rate * t).T * a for t, a in zip(times, truth)), mp.zeros(3))
            u, _, v = mp.svd_r(total)
            dcm = u * v
            about_pole = [(e[0, 1] - e[1, 0]) / 2 for e in (a * (turn(rate * t) * dcm).T for t, a in zip(times, truth))]
            rate += sum((t - middle) * e for t, e in zip(times, about_pole)) / sum((t - middle)**2 for t in times)
        assert abs(rate - fit["rate"]) * middle < 1e-14
        assert max(abs(dcm[i, j] - fit["dcm_PN"][i, j]) for i in range(3) for j in range(3)) < 1e-14


def test_a_bound_that_cannot_be_held_is_refused():
    sky = sky_of(world.EARTH)
    with pytest.raises(SetupError, match="holds EARTH within .* m over 3.15.* s, not within 1 m; take a shorter"):
        world.fit_orientation(sky, world.EARTH, within=1 * m, duration=365 * day)
    with pytest.raises(SetupError, match="within and duration must be > 0"):
        world.fit_orientation(sky, world.EARTH, within=1 * m, duration=0 * minute)
    with pytest.raises(TypeError, match="fit_orientation has no 'withn'; did you mean 'within'"):
        world.fit_orientation(sky, world.EARTH, withn=1, duration=1 * day)
    with pytest.raises(SetupError, match="within"):
        world.fit_orientation(sky, world.EARTH, within=1 * s, duration=1 * day)

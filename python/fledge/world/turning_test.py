# SPDX-License-Identifier: Apache-2.0
"""Ground targets of flight that turn as fitted, against the Sky that they come from."""

from pathlib import Path

import numpy as np
import pytest

from fledge import SetupError, Simulation, flight as fsw, world
from fledge.units import day, deg, hour, m, minute, s

DE405 = Path("/usr/share/casacore/data/ephemerides/DE405")
pytestmark = pytest.mark.skipif(not DE405.exists(), reason="not here: the package casacore-data-jpl-de405")
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

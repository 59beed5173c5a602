# SPDX-License-Identifier: Apache-2.0
"""Sun-synchronous orbits as J2 flies them, and local times of nodes against the right ascension of the Sun."""

import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, flight as fsw, mean_elements, world
from fledge.units import day, deg, hour, km, minute, s
from tests.needs import needs

pytestmark = needs("casacore-data-jpl-de405")
DATE = "2026-03-20T10:00:00"


@pytest.fixture(scope="module")
def sky():
    return world.Sky(DATE, center=world.EARTH)


def nodes(sky, body, orbit, days, step):
    """(t [s], right ascension [rad] about the body's true equator) at each pass northwards, as J2 alone flies it."""
    sim = Simulation("nodes")
    w = sim.world
    w.craft = world.Spacecraft(mass=1, I_B=1, gravity=[body.zonal(2)], orbit=orbit, sky=sky)
    w.integrator = world.RK4()
    w.task("dynamics", every=step, run=[w.craft])
    log = sim.record(w.craft.state, every=step)
    sim.run(days * day)
    axes = np.array(orbit.frame)
    r, v = log["state.r_BN_N"] @ axes.T, log["state.v_BN_N"] @ axes.T
    at = np.flatnonzero((r[:-1, 2] < 0) & (r[1:, 2] >= 0)) + 1
    h = np.cross(r[at], v[at])
    return log.time[at], np.unwrap(np.arctan2(h[:, 0], -h[:, 1])), np.linalg.norm(r, axis=1)


@pytest.mark.parametrize("altitude, u", [(500 * km, 0 * deg), (800 * km, 70 * deg)])
def test_the_plane_follows_the_sun_as_j2_flies_it(sky, altitude, u):
    orbit = Orbit.sun_synchronous(sky, altitude, ltan=22.5 * hour, u=u)
    t, node, r = nodes(sky, world.EARTH, orbit, 5, 20 * s)
    rate = np.polyfit(t, node, 1)[0] * 86400 * 180 / np.pi
    assert rate == pytest.approx(360 / 365.25636, rel=2e-3)      # the second order of J2 is left out
    # A circle of that semi-major axis: without the terms of short period it would differ by 9 km.
    a = world.EARTH.radius + float(altitude / (1 * km)) * 1e3
    k = world.EARTH.zonal(2).J[0] * (world.EARTH.radius / a)**2 / 2
    mean = a * (1 - 1.5 * k * (3 * np.cos(orbit.i)**2 - 1))
    assert abs((r.max() + r.min()) / 2 - mean) < 200 and r.max() - r.min() < 4.5e3
    period = np.diff(t).mean()
    assert period == pytest.approx(2 * np.pi * np.sqrt(a**3 / world.EARTH.mu), rel=3e-3)


def test_about_mars_the_true_suns_local_time_stays(sky):
    mars = world.Sky(DATE, center=world.MARS)
    orbit = Orbit.sun_synchronous(mars, 400 * km, ltan=15 * hour, body=world.MARS, apparent=True)
    t, node, _ = nodes(mars, world.MARS, orbit, 5, 30 * s)
    assert np.polyfit(t, node, 1)[0] * 86400 * 180 / np.pi == pytest.approx(360 / 686.98, rel=4e-3)
    sun = mars.state(world.SUN, 0, world.MARS).r_PN_N @ np.array(orbit.frame).T
    assert orbit.local_time_of_node(mars, apparent=True) == pytest.approx(15 * 3600, abs=2)
    assert (orbit.Omega - np.arctan2(sun[1], sun[0])) % (2 * np.pi) * 12 / np.pi == pytest.approx(3, abs=2e-3)


@pytest.mark.parametrize("date", ["2026-03-20T10:00:00", "2030-11-03T23:10:00", "2001-06-21T00:00:00"])
@pytest.mark.parametrize("ltan", [0, 6, 10.5, 23.75])
def test_local_time_is_that_of_the_mean_and_of_the_true_sun(date, ltan):
    sky = world.Sky(date, center=world.EARTH, earth=world.EarthOrientation(ut1_tai=-37 if date > "2017" else -32))
    orbit = Orbit.sun_synchronous(sky, 600 * km, ltan=ltan * hour)
    axes = np.array(sky.true_of_date())
    node = axes[0] * np.cos(orbit.Omega) + axes[1] * np.sin(orbit.Omega)
    x, y, _ = sky.orientation(world.EARTH).dcm_PN @ node
    hours, minutes = map(int, date[11:16].split(":"))           # of UTC, and the longitude by the Earth's rotation
    assert around(hours + minutes / 60 + np.arctan2(y, x) * 12 / np.pi - ltan) < 2 / 3600
    assert around(orbit.local_time_of_node(sky) / 3600 - ltan) < 1e-6
    sun = axes @ sky.state(world.SUN).r_PN_N
    true = (orbit.Omega - np.arctan2(sun[1], sun[0])) * 12 / np.pi + 12
    assert around(orbit.local_time_of_node(sky, apparent=True) / 3600 - true) < 1e-6
    assert 10 / 3600 < around(true - ltan) < 17 / 60           # the equation of time
    again = Orbit.sun_synchronous(sky, 600 * km, ltan=ltan * hour, apparent=True)
    assert around(again.local_time_of_node(sky, apparent=True) / 3600 - ltan) < 1e-6


def around(hours):
    return abs((hours + 12) % 24 - 12)


def test_a_node_that_stands_still_gains_what_the_sun_goes(sky):
    orbit = Orbit(world.EARTH, altitude=500 * km, i=50 * deg, Omega=1.0, frame=sky.true_of_date())
    gained = orbit.local_time_of_node(sky, 10 * day) - orbit.local_time_of_node(sky)
    assert gained == pytest.approx(-10 * 0.9856474 * 240, abs=1)
    assert orbit.local_time_of_node(sky, 15 * minute) == pytest.approx(orbit.local_time_of_node(sky), abs=3)


@pytest.mark.parametrize("words, given", [
    ("no plane turns fast enough", {"altitude": 7000 * km}),
    (r"1e\+100 km over EARTH no plane turns fast enough", {"altitude": 1e103}),
    ("no plane turns fast enough", {"altitude": 1e308}),
    ("must lie outside EARTH, of radius 6378136.3 m; found -1e\\+103 m", {"altitude": -1e103}),
    ("found 6378036.3 m from its centre", {"altitude": -100}),
    ("Orbit: u must be finite; found inf rad", {"u": float("inf")}),
    ("Orbit: u must be within 2 pi, or have a unit; found 90 rad: write 90 \\* deg", {"u": 90}),
    ("expected a planet with a known J2, of MERCURY, ", {"body": world.MOON}),
    ("write apparent=True", {"body": world.MARS}),
    ("ltan", {"ltan": 10 * deg}),
    ("altitude", {"altitude": 10 * s}),
])
def test_impossible_orbits_are_refused(sky, words, given):
    with pytest.raises(SetupError, match=words):
        Orbit.sun_synchronous(sky, **{"altitude": 500 * km, "ltan": 10 * hour, **given})


TLE = """1 99999U 26001A   26079.41666667  .00001000  00000+0  50000-4 0  9999
2 99999  51.6400 250.1234 0004000  80.0000 280.1500 15.49000000    18
"""


def test_from_mean_elements_the_world_begins_at_flights_position():
    elements = mean_elements.read(TLE).parameters()
    sky = world.Sky("2026-03-20T12:00:00.25", center=world.EARTH)
    sim = Simulation("both")
    f = sim.flight
    f.clock, f.orbit = fsw.UtcCorrelation(time_0=(9575 * 86400 + 0.25) * s), fsw.OrbitOnBoard(**elements)
    f.connect(f.clock.time >> f.orbit.time)
    f.task("all", every=1 * hour, run=[f.clock, f.orbit])
    for hours in (0, 1):
        sim.run(hours * hour)
        orbit = Orbit.from_elements(sky, hours * hour, **elements)
        assert np.linalg.norm(np.array(orbit.r_BN_N) - f.orbit.orbit.r_BN_N) < 0.01    # TDB and UTC differ
        assert np.linalg.norm(np.array(orbit.v_BN_N) - f.orbit.orbit.v_BN_N) < 1e-5
    assert 6.78e6 < orbit.a < 6.82e6 and orbit.i == pytest.approx(np.radians(51.64), abs=3e-3)
    with pytest.raises(SetupError, match="SGP4 gives no position .*: DECAYED$"):
        Orbit.from_elements(sky, **elements | {"n": 20 * elements["n"]})

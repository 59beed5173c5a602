# SPDX-License-Identifier: Apache-2.0
"""The solar system from Python: dates, places and orientations, flights in it, and what is refused."""

import os
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import Orbit, Simulation, SetupError, _core, world
from fledge.montecarlo.dispersions_test import mission
from fledge.montecarlo import Campaign
from fledge.units import day, deg, hour, km, m, minute, s

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data"))
DE405 = Path("/usr/share/casacore/data/ephemerides/DE405")
NOON = "2015-03-02T12:00:00 TDB"
AU = 149597870700.0

pytestmark = pytest.mark.skipif(not DE405.exists(), reason="not here: the package casacore-data-jpl-de405")


def real(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"not here: {path}")
    return path


@pytest.fixture(scope="module")
def sky():
    return world.Sky(NOON, center=world.MARS)


def says(words, action):
    with pytest.raises(SetupError) as error:
        action()
    assert words in str(error.value)


def fly(duration=5, step=1 * s, method=None, **instances):
    """A simulation of these models alone, flown."""
    sim = Simulation("sky")
    for name, model in instances.items():
        setattr(sim.world, name, model)
    if method:
        sim.world.integrator = method
    sim.world.task("world", every=step, run=list(sim.world))
    sim.run(duration)
    return sim


# --- when and where --------------------------------------------------------------------------------

def test_dates_go_there_and_back(sky):
    assert sky.tdb() == NOON
    assert sky.utc().startswith("2015-03-02T11:58:52.8146")  # 35 + 32.184 s, and TDB - TT = 1.4 ms
    assert sky.epoch_at(1 * day) == 478_569_600 + 86400
    assert sky.tdb(2 * day + 0.5 * s) == "2015-03-04T12:00:00.5 TDB"
    assert sky.time_of(sky.utc(7 * hour)) == 7 * 3600
    assert world.Sky("2015-03-02T12:00:00", "Mars").time_of(NOON) == pytest.approx(-67.185, abs=1e-3)


def test_a_leap_second_is_in_utc_and_not_in_the_run(sky):
    before = world.Sky("2016-12-31T23:59:59", center=world.SSB)
    assert [before.utc(t)[:20] for t in (1.5, 2.5)] == ["2016-12-31T23:59:60.", "2017-01-01T00:00:00."]
    # A file that ends before it does not know it.
    old = world.Sky("2016-12-31T23:59:59", center=world.SSB, leap_seconds=real("naif0011.tls"))
    assert old.utc(1.5).startswith("2017-01-01T00:00:00.")


def test_states_are_relative_to_the_center_or_another_body(sky):
    earth, sun = sky.state(world.EARTH, 1 * hour), sky.state("Sun", 1 * hour)
    np.testing.assert_allclose(earth.r_PN_N - sun.r_PN_N, sky.state(399, hour, center=10).r_PN_N, atol=1e-3)
    assert np.linalg.norm(sky.state("EARTH", center="SUN").r_PN_N) / AU == pytest.approx(0.991, abs=1e-3)
    assert not np.any(sky.state(world.MARS, 1 * day).r_PN_N)
    assert (earth.head.t, earth.head.quality.name) == (3_600_000_000_000, "GOOD")
    dt = 100.0
    ahead, behind = sky.state(world.EARTH, hour + dt * s), sky.state(world.EARTH, hour - dt * s)
    np.testing.assert_allclose((ahead.r_PN_N - behind.r_PN_N) / (2 * dt), earth.v_PN_N, atol=1e-4)
    np.testing.assert_allclose((ahead.v_PN_N - behind.v_PN_N) / (2 * dt), earth.a_PN_N, atol=1e-9)


def test_a_kernel_stands_in_the_place_of_de405_or_before_it(sky):
    kernel = real("de430-2015-03-02.bsp")
    other = world.Sky(NOON, center=world.MARS, kernels=kernel, leap_seconds=str(real("naif0011.tls")))
    assert "MARS (499)" not in other.bodies and "MARS BARYCENTER (4)" in other.bodies
    apart = np.linalg.norm(other.state(world.SUN).r_PN_N - sky.state(world.SUN).r_PN_N)
    assert 0 < apart < 2e3  # between the two ephemerides
    both = world.Sky(NOON, center=world.MARS, kernels=["DE405", kernel])
    assert list(both.state(world.SUN).r_PN_N) == list(other.state(world.SUN).r_PN_N)
    assert list(both.state(world.SUN, 900 * day).r_PN_N) == list(sky.state(world.SUN, 900 * day).r_PN_N)


def test_orientations_turn_once_a_day_about_the_pole(sky):
    dcm, omega = sky.orientation(world.MARS)
    np.testing.assert_allclose(dcm @ dcm.T, np.eye(3), atol=1e-15)
    assert np.arccos(dcm[2] @ world.MARS.pole_N) < 0.02 * np.pi / 180  # precession since 2000
    turn = 2 * np.pi / np.linalg.norm(omega)
    assert turn == pytest.approx(88642.66, abs=0.01)
    np.testing.assert_allclose(sky.orientation(world.MARS, turn).dcm_PN, dcm, atol=1e-7)
    kernel = world.Sky(NOON, center=world.MARS, pck=real("pck00008.tpc"))
    np.testing.assert_allclose(kernel.orientation("Mars").dcm_PN, dcm, atol=1e-14)
    assert kernel.orientation("Io").dcm_PN.shape == (3, 3)  # which only the file has


# --- flights ---------------------------------------------------------------------------------------

def orbiter(sky, **changes):
    return world.Spacecraft(**{"I_B": 100, "sky": sky, "gravity": [world.MARS, world.SUN, world.JUPITER],
                               "orbit": Orbit(world.MARS, a=20000 * km, e=0.3, i=1 * deg), **changes})


def test_a_body_is_a_model_whose_state_can_be_wired(sky):
    sim = fly(10, earth=world.CelestialBody(body=world.EARTH, sky=sky), craft=orbiter(sky))
    earth = sim.world.earth
    assert list(earth.state.r_PN_N) == list(sky.state(world.EARTH, 10).r_PN_N)
    assert list(earth.state.a_PN_N) == list(sky.state(world.EARTH, 10).a_PN_N)
    assert earth.state.head.t == 10_000_000_000
    assert "EARTH (399)" in repr(earth) and "N about MARS" in repr(earth) and earth.id == 399


def test_a_flight_is_the_same_about_mars_and_about_the_barycentre(sky):
    ends = []
    everything = [*(b for b in world.BODIES.values() if b is not world.PLUTO), world.PLUTO_SYSTEM]
    for center, keywords in ((world.MARS, ("sky", "orbit")), (world.SSB, ("sky", "orbit")),
                             (world.SSB, ("orbit", "sky"))):
        given = world.Sky(NOON, center=center)
        values = {"sky": given, "orbit": Orbit(world.MARS, a=20000 * km, e=0.3, i=1 * deg)}
        craft = world.Spacecraft(I_B=1, gravity=everything, **{k: values[k] for k in keywords})
        sim = fly(6 * hour, 60 * s, world.Adaptive(relative=1e-12, absolute=1e-6), craft=craft)
        ends.append(sim.world.craft.state.r_BN_N - given.state(world.MARS, 6 * hour).r_PN_N)
    # About Mars it falls as the sum of the bodies says, about the barycentre as the ephemeris does.
    assert np.linalg.norm(ends[0] - ends[1]) < 0.1  # [m] found: 0.02
    np.testing.assert_array_equal(ends[1], ends[2])
    # Without the Sun it is a flight about Mars alone.
    alone = fly(6 * hour, 60 * s, world.Adaptive(relative=1e-12, absolute=1e-6),
                craft=orbiter(sky, gravity=[world.MARS]))
    assert 10 < np.linalg.norm(alone.world.craft.state.r_BN_N - ends[0]) < 1e4


def test_a_field_turns_with_its_planet(sky):
    mars = world.MARS.harmonics(real("mars-ggm2bc80.shadr.csv"), degree=20)
    assert (mars.radius, mars.field.degree) == (3397e3, 20) and "harmonics to degree 20" in repr(mars)
    craft = world.Spacecraft(I_B=1, sky=sky, gravity=[mars], orbit=Orbit(mars, altitude=400 * km, i=93 * deg))
    sim = fly(10 * minute, 10 * s, craft=craft)
    state = sim.world.craft.state
    # About a point of the same mass, by finite differences of what the field's own frame would say.
    dcm = sky.orientation(world.MARS, 10 * minute).dcm_PN
    r_P = dcm @ state.r_BN_N
    point = -mars.mu * state.r_BN_N / np.linalg.norm(state.r_BN_N)**3
    extra = dcm @ (state.a_BN_N - point)
    J2 = world.MARS._known[0]
    z2 = 5 * r_P[2]**2 / (r_P @ r_P)
    oblate = -1.5 * J2 * mars.mu * mars.radius**2 / np.linalg.norm(r_P)**5 * r_P * np.array([1 - z2, 1 - z2, 3 - z2])
    assert np.linalg.norm(extra - oblate) < 0.4 * np.linalg.norm(oblate)  # J2 is most of it, not all
    assert np.linalg.norm(extra - oblate) > 0.01 * np.linalg.norm(oblate)
    assert sim.world.craft.gravity[0].field.degree == 20


def test_clones_go_on_alike(sky):
    sim = fly(10, earth=world.CelestialBody(body=world.EARTH, sky=sky), craft=orbiter(sky))
    clone = sim.clone()
    assert "N about MARS" in repr(clone.world.craft.sky)
    for one in (sim, clone):
        one.run(100)
    assert sim.snapshot() == clone.snapshot()


def test_what_stands_for_what_is_said(sky):
    sim = fly(1, craft=orbiter(sky), jupiter=world.CelestialBody(body=world.JUPITER, sky=sky))
    assert sim.assumptions == [
        "world.craft.gravity: the ephemeris has no JUPITER (599); JUPITER BARYCENTER (5) stands for it, with the mass "
        "of its moons",
        "world.jupiter.state: the ephemeris has no JUPITER (599); it is that of JUPITER BARYCENTER (5)"]


# --- what is refused -------------------------------------------------------------------------------

def test_skies_that_cannot_be(tmp_path):
    kernel = real("de430-2015-03-02.bsp")
    damaged = tmp_path / "damaged.bsp"
    damaged.write_bytes(kernel.read_bytes()[:5000])
    for words, arguments in (
            ('Sky: time "yesterday": expected a date as in 2015-03-02T12:00:00', ("yesterday", "MARS")),
            ("Sky: epoch: expected a text like", (5, "MARS")),
            ('Sky: center: no body is named "Vulcan"; give a NAIF number or one of SOLAR', (NOON, "Vulcan")),
            ("Sky: center: expected a body, such as world.MARS", (NOON, world.Body("ROCK", 1, 1))),
            (f"Sky: {DE405}: no PHOBOS (401); asked for PHOBOS (401)", (NOON, "PHOBOS")),
            ("Sky: MARS BARYCENTER (4) is given from 1959-12-10T00:00:00 TDB to 2060-01-30T00:00:00 TDB in "
             f"{DE405}; asked for MARS (499) relative to SOLAR SYSTEM BARYCENTER (0) at 2065-01-01T00:00:00 TDB",
             ("2065-01-01 TDB", "MARS")),
            ("Sky: nope.bsp: cannot be opened", (NOON, "MARS", "nope.bsp")),
            (f"Sky: {damaged}: ", (NOON, "MARS", [damaged])),
            ("is no SPICE SPK kernel", (NOON, "MARS", real("pck00008.tpc"))),
            ("Sky: kernels: expected the path of a file; found 5", (NOON, "MARS", [5]))):
        says(words, lambda: world.Sky(*arguments))
    says("Sky: nope.tls: cannot be opened", lambda: world.Sky(NOON, "MARS", leap_seconds="nope.tls"))
    says(f"Sky: {kernel}: holds binary data", lambda: world.Sky(NOON, "MARS", pck=kernel))
    leaps = real("naif0011.tls")
    says(f"Sky: {leaps}: says of no body how it turns", lambda: world.Sky(NOON, "MARS", pck=leaps))


def test_questions_without_an_answer(sky):
    says(f"{DE405}: no IO (501); asked for", lambda: sky.state("Io"))
    says("is given from 1959-12-10", lambda: sky.state("SUN", 100 * 365 * day))
    says("Sky.state: t: expected a time, found 5.0 m", lambda: sky.state("SUN", 5 * m))
    says("Sky.utc: t: expected a time within 292 years", lambda: sky.utc(1e12))
    says("no orientation is built in for IO (501); it is for SUN (10), ", lambda: sky.orientation("Io"))
    says("MARS.harmonics: nope.gfc: cannot be opened", lambda: world.MARS.harmonics("nope.gfc"))
    says("MARS.harmonics: degree must be a whole number >= 0; found -1",
         lambda: world.MARS.harmonics("nope.gfc", degree=-1))
    mars = real("mars-ggm2bc80.shadr.csv")
    says("degree 100 was asked for; it has 80", lambda: world.MARS.harmonics(mars, degree=100))
    says(f"VENUS.harmonics: {mars} is another body's field: its mu is 4.28283719e+13 m^3/s^2",
         lambda: world.VENUS.harmonics(mars, degree=2))
    says("MARS.zonal(2): it has a whole field", lambda: world.MARS.harmonics(mars, degree=2).zonal(2))


def test_flights_that_cannot_be(sky):
    says("world.earth.sky is missing: the sky in which EARTH (399) is",
         lambda: fly(earth=world.CelestialBody(body=world.EARTH)))
    says("world.io: " + str(DE405) + ": no IO (501); asked for",
         lambda: fly(io=world.CelestialBody(body="Io", sky=sky)))
    says("world.nothing.id is required", lambda: fly(nothing=world.CelestialBody(sky=sky)))
    says('CelestialBody.body: no body is named "Vulcan"', lambda: world.CelestialBody(body="Vulcan"))
    says("Spacecraft.sky: expected world.Sky(epoch, center, ...); found 'DE405'",
         lambda: world.Spacecraft(sky="DE405"))
    says("CelestialBody.sky: it already has one, <Sky from 2015",
         lambda: setattr(world.CelestialBody(sky=sky), "sky", sky))
    says("world.craft.gravity: MARS was given a position, but the sky holds its position",
         lambda: fly(craft=orbiter(sky, gravity=[world.MARS.at([1e9, 0, 0])])))
    says("world.craft.gravity: ROCK has no NAIF number, by which the sky would find it",
         lambda: fly(craft=orbiter(sky, gravity=[world.Body("ROCK", 1e3, 1.0)])))
    says("world.craft.gravity: EARTH MOON BARYCENTER (3) holds MOON (301): name the system or its members, not both",
         lambda: fly(craft=orbiter(sky, gravity=[world.EMB, world.MOON])))
    says("world.craft.r_BN_N: must lie outside MARS",
         lambda: fly(craft=orbiter(sky, orbit=Orbit(world.MARS.with_surface(0), altitude=-1 * km))))
    mars = world.MARS.harmonics(real("mars-ggm2bc80.shadr.csv"), degree=4)
    says("world.craft.gravity: the field of MARS turns with it: give a sky",
         lambda: fly(craft=world.Spacecraft(I_B=1, gravity=[mars], orbit=Orbit(mars, a=2e7))))


def test_runs_beyond_the_ephemeris_are_refused_before_they_begin(sky, tmp_path):
    sim = fly(5, earth=world.CelestialBody(body=world.EARTH, sky=sky), craft=orbiter(sky))
    sim.record(sim.world.craft.state)
    sim.archive(tmp_path / "run.mcap")
    with pytest.raises(SetupError) as error:
        sim.run(46 * 365 * day)
    lines = str(error.value).split("\n")
    assert lines[0].startswith("world.earth: EARTH (399) is given from 1959-12-10T00:00:00 TDB to 2060-01-30T00:00:00")
    assert lines[1].startswith("world.craft.gravity: SUN (10) is given from ") and lines[1].endswith(" TDB")
    assert sim.time == 5 and not list(tmp_path.iterdir())
    sim.run(5)
    assert sim.time == 10


CAMPAIGN = """
from fledge.units import day, deg, s
def release(d):
    d.duration, d.every = {days} * day, 3600 * s
    d["world.craft.omega_BN_B"] = d.normal(0, 1 * deg / s)
    d.retain("world.nav.attitude.sigma_BN")
"""

IN_THE_SKY = """
    w.craft.sky = world.Sky("2060-01-29", center=world.MARS)
    w.craft.gravity = [world.SUN]
"""


def test_campaigns_share_the_sky_and_are_refused_beyond_it(tmp_path):
    mission(tmp_path, CAMPAIGN.format(days=2), IN_THE_SKY)
    says("world.craft.gravity: SUN (10) is given from", lambda: Campaign(tmp_path).fly(3))
    mission(tmp_path, CAMPAIGN.format(days=0.005), IN_THE_SKY)
    one, two = (Campaign(tmp_path).fly(4, seed=1, threads=n) for n in (1, 2))
    assert not any(one.failures)
    for path in one.retained:
        np.testing.assert_array_equal(one.retained[path], two.retained[path])


def test_a_mission_names_the_file_and_the_line(tmp_path):
    mission(tmp_path, CAMPAIGN, '\n    w.craft.sky = world.Sky("2015-03-02", center="Vulcan")\n')
    with pytest.raises(fledge.MissionError, match=r'world.py, line \d+: Sky: center: no body is named "Vulcan"'):
        fledge.load(tmp_path)


def test_names_of_bodies_agree_with_the_library():
    for body in world.BODIES.values():
        assert _core.body_name(body.naif) == f"{body.name} ({body.naif})"
        assert _core.body_mu(body.naif) == pytest.approx(body.mu, rel=3e-6)

# SPDX-License-Identifier: Apache-2.0
"""Bodies from kernels, and the tides of the solid Earth in a run."""
import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, world
from fledge.files import spk
from fledge.units import day, deg, km, minute, s
from fledge.world.sky_test import fly, real
from tests.needs import needs

with_sky = needs("casacore-data-jpl-de405")

GM = """\\begindata
BODY499_GM       = ( 4.2828373620699090E+04 )
BODY499_RADII    = ( 3000, 3002, 2990 )
BODY2000433_GM   = 4.463E-04
BODY399_J2       = 1.082616D-3
BODY399_J4       = -1.65597E-6
BODY5_GM         = -1
"""


@pytest.fixture
def kernel(tmp_path):
    (tmp_path / "gm.tpc").write_text(GM)
    return tmp_path / "gm.tpc"


def test_a_kernel_gives_mu_radius_and_zonal_harmonics(kernel):
    mars = world.MARS.with_kernel(kernel)
    assert mars.mu == pytest.approx(4.2828373620699090e13, rel=1e-15) and mars.radius == 3001e3
    # J_n R^n, so gravity at a place, is the same about another radius of reference.
    for n, (old, new) in enumerate(zip(world.MARS._known, mars._known), 2):
        assert new * mars.radius**n == pytest.approx(old * world.MARS.radius**n, rel=1e-14)
    eros = world.Body("EROS", 0, 0, naif=2000433).with_kernel(kernel)
    assert (eros.mu, eros.radius) == (4.463e5, 0)
    earth = world.EARTH.with_kernel(kernel).zonal(4)
    assert earth.J == (1.082616e-3, 0, -1.65597e-6, 0, 0) and earth.mu == world.EARTH.mu


def test_a_kernel_without_the_body_is_refused(kernel):
    for words, make in (
            ("VENUS.with_kernel: " + str(kernel) + ": has none of BODY299_GM", lambda: world.VENUS.with_kernel(kernel)),
            (f"{kernel}:7: BODY5_GM must be > 0; found -1", lambda: world.JUPITER_SYSTEM.with_kernel(kernel)),
            ("ROCK.with_kernel: the body has no NAIF number", lambda: world.Body("ROCK", 1, 1).with_kernel(kernel)),
            ("call zonal or harmonics afterwards", lambda: world.MARS.zonal(2).with_kernel(kernel))):
        with pytest.raises(SetupError) as error:
            make()
        assert words in str(error.value)


def flight(duration, tides, earth=None):
    sky = world.Sky("2008-09-20 TDB", "EARTH", earth=earth)
    earth = world.EARTH.harmonics(real("earth-ggm03s.shadr.csv"), 4, tides=tides)
    craft = world.Spacecraft(I_B=1, sky=sky, gravity=[earth], orbit=Orbit(earth, altitude=500 * km, i=60 * deg))
    return fly(duration, 30 * s, craft=craft)


@with_sky
def test_tides_bend_a_low_orbit():
    sims = [flight(day, tides) for tides in (False, "zero_tide")]
    r = [np.array(sim.world.craft.state.r_BN_N) for sim in sims]
    assert 2 < np.linalg.norm(r[1] - r[0]) < 50  # [m] found: 8.4


@with_sky
def test_tides_in_a_run_are_those_of_the_direct_formula():
    sims = [flight(30 * s, tides) for tides in (False, "tide_free")]
    state, sky = sims[1].world.craft.state, sims[1].world.craft.sky
    found = np.array(state.a_BN_N) - np.array(sims[0].world.craft.state.a_BN_N)
    r, R = np.array(state.r_BN_N), 6378136.3
    expected = np.zeros(3)
    for body in (world.MOON, world.SUN):  # Montenbruck and Gill, equation 3.59
        p = np.array(sky.state(body).r_PN_N)
        d, e = np.linalg.norm(p), r / np.linalg.norm(r)
        c = e @ p / d
        expected += (0.15 * body.mu / d**3 * R**5 / np.linalg.norm(r)**4) * ((3 - 15 * c * c) * e + 6 * c * p / d)
    # Degree 3, the lags and the frequencies are the rest.
    assert np.linalg.norm(found - expected) < 0.05 * np.linalg.norm(expected)


@with_sky
def test_the_pole_moves_the_tides_where_it_is_known():
    def tide(**polar_motion):  # what tides add to the acceleration at the beginning
        earth = world.EarthOrientation(ut1_tai=-33, **polar_motion)
        found = [np.array(flight(30 * s, tides, earth=earth).world.craft.state.a_BN_N)
                 for tides in (False, "tide_free")]
        return found[1] - found[0]

    arcsec = np.radians(1 / 3600)
    secular = ((0.0550 + 0.001677 * 8.72) * arcsec, (0.3205 + 0.003460 * 8.72) * arcsec)  # on 2008-09-20
    assert np.linalg.norm(tide(polar_motion=secular) - tide()) < 1e-11  # without a pole there is no tide of it
    moved = tide(polar_motion=(secular[0] + 2 * arcsec, secular[1])) - tide(polar_motion=secular)
    # mu / r^2 of 8.4 m/s^2, (R / r)^2, and a gradient of the normalised term of degree 2, order 1, of 3 to 4.
    assert 0.5 * 2.667e-9 < np.linalg.norm(moved) / (8.4 * 0.86) / 3.5 < 1.2 * 2.667e-9


@with_sky
def test_clones_feel_the_same_tides():
    sim = flight(10 * minute, "zero_tide")
    clone = sim.clone()
    for run in (sim, clone):
        run.run(80 * minute)
    assert sim.snapshot() == clone.snapshot()


@pytest.mark.parametrize("there, missing", [("SUN", "MOON"), ("MOON", "SUN")])
def test_tides_need_the_moon_and_the_sun(tmp_path, there, missing):
    times = np.arange(-5, 6) * 86400 * 10**9  # [ns] past J2000
    r = np.outer(np.ones(11), [4e8, 0, 0])
    spk.write(tmp_path / "a.bsp", target=there, center="EARTH", times=times, r=r, v=0 * r)
    sky = world.Sky("2000-01-01T12:00:00 TDB", "EARTH", kernels=[tmp_path / "a.bsp"])
    earth = world.EARTH.harmonics(real("earth-ggm03s.shadr.csv"), 4, tides="zero_tide")
    craft = world.Spacecraft(I_B=1, sky=sky, gravity=[earth], orbit=Orbit(earth, altitude=500 * km))
    with pytest.raises(SetupError, match=f"gravity: tides need the Moon and the Sun in the sky: .*: no {missing} "):
        fly(30 * s, 30 * s, craft=craft)


def test_the_mu_of_a_body_says_the_unit_of_its_field(tmp_path):
    for mu, radius in (("446300", "16000"), ("4.463e-4", "16.0")):  # Eros, in m and in km
        (tmp_path / "eros.tab").write_text(f"{radius}, {mu}, 0, 0, 0, 1\n")
        eros = world.Body("EROS", 4.46e5, 16e3, naif=2000433).harmonics(tmp_path / "eros.tab")
        assert (eros.mu, eros.radius) == (pytest.approx(446300), 16000)
        unknown = world.Body("EROS", 0, 0, naif=2000433).harmonics(tmp_path / "eros.tab")  # then km, if below 100,000
        assert unknown.mu == pytest.approx(446300 if radius == "16.0" else 446300e9)


FIELD = """modelname DRIFTS
earth_gravity_constant 3.986004415e14
radius 6378136.3
max_degree 2
end_of_head
gfct 2 0 -4.84e-4 0 20050101
trnd 2 0 1e-6 0
gfc 2 1 0 0
gfc 2 2 0 0
"""


@with_sky
def test_a_field_that_changes_is_that_of_its_epoch(tmp_path):
    (tmp_path / "drifts.gfc").write_text(FIELD)
    with pytest.raises(SetupError, match=r"drifts\.gfc:6: its coefficients change in time; .* as in epoch="):
        world.EARTH.harmonics(tmp_path / "drifts.gfc")
    with pytest.raises(SetupError, match="EARTH.harmonics: epoch: expected a text like"):
        world.EARTH.harmonics(tmp_path / "drifts.gfc", epoch=2010)
    with pytest.raises(SetupError, match="EARTH.harmonics: .*no-date"):
        world.EARTH.harmonics(tmp_path / "drifts.gfc", epoch="no-date")

    def pull(file, **epoch):
        sky = world.Sky("2008-09-20 TDB", "EARTH")
        earth = world.EARTH.harmonics(tmp_path / file, **epoch)
        craft = world.Spacecraft(I_B=1, sky=sky, gravity=[earth], orbit=Orbit(earth, altitude=500 * km, i=60 * deg))
        return list(fly(30 * s, 30 * s, craft=craft).world.craft.state.a_BN_N)

    # 2025-01-01 is 7305 days later: 20 Julian years.
    (tmp_path / "stands.gfc").write_text(FIELD.replace("gfct", "gfc").replace("trnd 2 0 1e-6 0\n", "")
                                         .replace("-4.84e-4 0 20050101", "-4.64e-4 0"))
    changed = pull("drifts.gfc", epoch="2025-01-01 TDB")
    assert changed == pytest.approx(pull("stands.gfc"), rel=1e-13)
    assert changed != pytest.approx(pull("drifts.gfc", epoch="2005-01-01 TDB"), rel=1e-6)


def test_tides_need_the_earth_and_a_tide_system():
    file = real("earth-ggm03s.shadr.csv")
    for words, make in (
            ('tide_free or zero_tide, found unknown; give the field\'s: tides="zero_tide", say',
             lambda: world.EARTH.harmonics(file, 4, tides=True)),
            ("MARS.harmonics: tides are those of the solid Earth", lambda: world.MARS.harmonics(file, tides=True)),
            ("found 'mean'", lambda: world.EARTH.harmonics(file, tides="mean"))):
        with pytest.raises(SetupError) as error:
            make()
        assert words in str(error.value)
    assert repr(world.EARTH.harmonics(file, 4, tides="zero_tide")).endswith("degree 4, tides>")


# --- orbits and gravity ------------------------------------------------------------------------------------------

def flown(orbit, gravity, **craft):
    sim = Simulation("fits")
    sim.world.craft = world.Spacecraft(mass=1, I_B=1, gravity=gravity, orbit=orbit, **craft)
    sim.world.task("dynamics", every=1 * s, run=[sim.world.craft])
    return sim


def about(body, **shape):
    return Orbit(body, **(shape or {"altitude": 500 * km}))


@pytest.mark.parametrize("words, orbit, gravity", [
    (r"world.craft.orbit: it is about MARS, which does not attract the spacecraft: world.craft.gravity has EARTH, SUN$",
     about(world.MARS), [world.EARTH, world.SUN.at([1.5e11, 0, 0])]),
    ("it is about MARS, which does not attract the spacecraft: world.craft.gravity is empty$", about(world.MARS), []),
    (r"it is about EARTH with mu = 398600441500000 m\^3/s\^2, and world.craft.gravity has 4e\+14: give both the same "
     "body$", about(world.EARTH), [world.EARTH.with_mu(4e14)]),
    (r"gravity body EARTH: mu in m\^3/s\^2 and the radius in m must give a gravity of 1e-6 to 1e4 m/s\^2 there; "
     "found 9.79", about(world.EARTH), [world.EARTH.with_mu(398600.4418)]),
    ("must give a gravity of 1e-6 to 1e4", about(world.EARTH), [world.Body("EARTH", 3.986e14, 6378.0)]),
])
def test_an_orbit_that_does_not_fit_gravity_is_refused_before_the_flight(words, orbit, gravity):
    with pytest.raises(SetupError, match=words):
        flown(orbit, gravity).run(1 * s)


def test_an_orbit_and_gravity_may_have_the_same_body_from_two_sources():
    """mu of files differ by 1e-7 or so; a mission gives its initial state otherwise; a body has its shape in one."""
    flown(about(world.EARTH), [world.EARTH.with_mu(3.986004418e14)]).run(1 * s)
    flown(about(world.EARTH), [world.EARTH.zonal(4)]).run(1 * s)
    rock = world.Body("ROCK", 4.9, 245.0)
    flown(about(rock, a=1 * km), [world.EARTH.at([1e9, 0, 0]), rock]).run(1 * s)
    sim = flown(about(world.MARS), [world.EARTH])
    sim.world.craft.r_BN_N = [7e6, 0, 0]
    sim.world.craft.v_BN_N = [0, 7.5e3, 0]
    sim.run(1 * s)


@with_sky
def test_the_system_of_a_planet_attracts_where_an_orbit_is_about_the_planet():
    sky = world.Sky("2026-03-20T10:00:00", center=world.SUN)
    flown(about(world.PLUTO, a=1e6 * km), [world.PLUTO_SYSTEM, world.SUN], sky=sky).run(1 * s)
    with pytest.raises(SetupError, match="it is about PLUTO, which does not attract"):
        flown(about(world.PLUTO, a=1e6 * km), [world.NEPTUNE_SYSTEM, world.SUN], sky=sky).run(1 * s)


def test_bodies_at_one_place_need_a_sky():
    for other, gravity in (("SUN", [world.EARTH, world.SUN]), ("MOON", [world.EARTH, world.MOON])):
        with pytest.raises(SetupError, match=rf"world.craft.gravity: without a sky, EARTH and {other} are at one "
                                             r"place: give the spacecraft a sky, .* as in sky=world.Sky\(epoch, "):
            flown(about(world.EARTH), gravity).run(1 * s)
    flown(about(world.EARTH), [world.EARTH, world.MOON.at([384e6, 0, 0])]).run(1 * s)

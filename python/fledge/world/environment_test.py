# SPDX-License-Identifier: Apache-2.0
"""The environment of a spacecraft in missions: bodies, air, light, magnetic field, ground stations."""

import inspect

import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, world
from fledge.units import W, deg, kg, km, m, minute, rad, s
from tests.needs import needs

EARTH = world.EARTH
SPIN = 7.292115146706388e-5 * rad / s

needs_de405 = needs("casacore-data-jpl-de405")


def says(words, action):
    with pytest.raises(SetupError) as error:
        action()
    assert words in str(error.value)


def fly(duration, step=1 * s, wires=(), **models):
    """A simulation of these models, flown; each that needs the craft's state gets it."""
    sim = Simulation("environment")
    w = sim.world
    parts = [p for model in models.values() if isinstance(model, world.Spacecraft) for p in model.parts]
    for name, model in models.items():
        setattr(w, name, model)
    for model in models.values():
        if hasattr(model, "truth"):
            w.connect(models["craft"].state >> model.truth)
    for make in wires:
        w.connect(make(w))
    w.task("world", every=step, run=[model for model in models.values() if not any(model is p for p in parts)])
    sim.run(duration)
    return sim


# --- in a mission ----------------------------------------------------------------------------------

def surroundings(**changes):
    """A craft in a low orbit of the Earth in which everything acts, without a sky; and its models."""
    models = {"air": world.Atmosphere(body=EARTH, law="STANDARD_1976", spin=SPIN),
              "light": world.Sunlight(sun=world.SUN.at([1.5e11, 0, 0]), shadows=[EARTH]),
              "field": world.Magnetism(body=EARTH, dipole_P=[0, 0, -7.8e15], spin=SPIN),
              "station": world.GroundStation(body=EARTH, latitude=0, longitude=0, mask=5 * deg, spin=SPIN)}
    models |= {"drag": world.Drag(air=models["air"], Cd=2.2, area=1 * m**2),
               "solar": world.SolarPressure(light=models["light"], Cr=1.2, area=1 * m**2),
               "gradient": world.GravityGradient()}
    models["craft"] = world.Spacecraft(**{
        "mass": 100 * kg, "I_B": [10, 12, 14], "gravity": [EARTH], "orbit": Orbit(EARTH, altitude=400 * km),
        "parts": [models["drag"], models["solar"], models["gradient"]], **changes})
    return models


def test_all_of_it_together_is_repeated_by_clones():
    sim = fly(10 * minute, **surroundings())
    w = sim.world
    assert w.air.air.density == pytest.approx(2.8e-12, rel=0.01)
    assert np.linalg.norm(w.drag.load.force_B) == pytest.approx(1.1 * 2.8e-12 * 7180**2, rel=0.02)
    assert w.light.light.visible == 1 and w.light.light.irradiance == pytest.approx(1354, rel=1e-3)
    assert np.linalg.norm(w.solar.load.force_B) == pytest.approx(1.2 * 1354 / 299792458, rel=1e-3)
    assert np.linalg.norm(w.field.field.B_N) == pytest.approx(7.8e15 / 6778e3**3, rel=1e-3)
    # It flew over the station 10 minutes ago, and is gone.
    assert w.station.contact.elevation < 0 and w.station.contact.visible == 0
    assert w.station.contact.azimuth == pytest.approx(np.pi / 2)
    assert w.station.contact.range_rate == pytest.approx(6580, rel=0.01)  # 7180 m/s cos(24 deg)
    assert w.drag.air is w.air and w.solar.light is w.light
    assert w.air.body.name == "EARTH" and [b.name for b in w.light.shadows] == ["EARTH"] and w.light.sun.name == "SUN"
    clone = sim.clone()
    for simulation in (sim, clone):
        simulation.run(40 * minute)
    assert sim.snapshot() == clone.snapshot()
    assert w.light.light.visible == 0 and not np.any(w.solar.load.force_B)


def test_sun_sensors_are_dark_in_the_shadow():
    models = surroundings()
    models["css"] = world.CoarseSunSensors(axes_B=[[1, 0, 0], [-1, 0, 0]], current=[1e-3, 1e-3])
    sim = fly(1, wires=[lambda w: w.light.light >> w.css.light], **models)
    assert sim.world.css.currents.current[0] == pytest.approx(1e-3)
    sim.run(46 * minute)
    assert sim.world.light.light.visible == 0 and not np.any(sim.world.css.currents.current)


def test_a_battery_empties_in_the_shadow_and_panels_fill_it():
    models = surroundings()
    models["array"] = world.SolarArray(normals_B=[[1, 0, 0]], areas=[0.2], efficiency=0.3)
    models["power"] = world.PowerUnit(n=1, on=1, volts=30, load=[30], count_current=1e-3, count_volts=1e-3,
                                      battery=80e3, charge=1)
    sim = fly(1, wires=[lambda w: w.light.light >> w.array.light, lambda w: w.array.array >> w.power.array], **models)
    power = sim.world.power
    sim.run(28 * minute)
    assert power.energy == 80e3 and sim.world.array.array.power == pytest.approx(81, rel=0.05)
    sim.run(30 * minute)  # in the shadow, where the load takes 30 W
    assert 80e3 - power.energy == pytest.approx(30 * 30 * 60, rel=0.02)
    low = power.energy
    sim.run(20 * minute)  # of which 14 in the light again
    assert power.energy > low + 20e3


def test_a_planets_light_pushes_disturbs_sensors_and_is_repeated_by_clones():
    models = surroundings()
    models["shine"] = world.PlanetRadiation(body=EARTH, light=models["light"], albedo=0.3, emissivity=0.7)
    models["solar"].radiation = models["shine"]
    models["css"] = world.CoarseSunSensors(axes_B=[[0, 1, 0], [0, -1, 0]], current=[1e-3, 1e-3],
                                           radiation=models["shine"])
    sim = fly(10 * minute, wires=[lambda w: w.light.light >> w.css.light], **models)
    w = sim.world
    assert w.solar.light is w.light and w.solar.radiation is w.shine and w.shine.light is w.light
    assert w.shine.body.name == "EARTH"
    # The orbit is that of the equator, and the Sun is in x: the craft is 39 deg past noon, and the Earth in -y, too.
    r, planet = w.craft.state.r_BN_N, w.shine.planet
    up, part = r / np.linalg.norm(r), (w.shine.body.radius / np.linalg.norm(r))**2
    assert planet.infrared_N == pytest.approx(-0.7 / 4 * 1361 * part * up, rel=0.01)
    assert planet.sunlight == pytest.approx(1354, rel=1e-3)
    assert 0.6 * 0.3 * 1361 * part < np.linalg.norm(planet.reflected_N) < 0.3 * 1361 * part
    push = np.linalg.norm([-1354, 0, 0] - planet.infrared_N - planet.reflected_N)
    assert np.linalg.norm(w.solar.load.force_B) * 299792458 / 1.2 == pytest.approx(push, abs=1)
    assert 0 < 2 * w.css.currents.current[0] < w.css.currents.current[1] < 0.2e-3
    clone = sim.clone()
    assert w.css.radiation is w.shine and clone.world.css.radiation is clone.world.shine
    assert clone.world.solar.radiation is clone.world.shine and clone.world.solar.light is clone.world.light
    for simulation in (sim, clone):
        simulation.run(40 * minute)
    assert sim.snapshot() == clone.snapshot()
    night = np.linalg.norm(w.shine.planet.infrared_N)
    assert np.linalg.norm(w.solar.load.force_B) * 299792458 / 1.2 == pytest.approx(night, rel=1e-9)
    says("expected a model of the world, as in world.PlanetRadiation(...); found",
         lambda: world.SolarPressure(radiation=world.Sunlight()))


@needs_de405
@pytest.mark.parametrize("epoch", ["2017-08-21", "2026-01-05"])
def test_the_earths_light_is_the_integral_over_its_surface(epoch):
    # Lambert's law over a fine grid of the ground: dE = L dA cos(a) / d^2, with Knocke's coefficients.
    sky = world.Sky(epoch, center=EARTH)
    R, E = EARTH.radius, 1361 * (149597870700 / np.linalg.norm(sky.state(world.SUN).r_PN_N))**2
    sun_N, dcm_PN = sky.state(world.SUN).r_PN_N, sky.orientation(EARTH).dcm_PN
    days = (sky.epoch_at(0) / 86400 + 6584.5)
    sines, turns = np.meshgrid((np.arange(1000) + 0.5) / 500 - 1, (np.arange(1000) + 0.5) * 2 * np.pi / 1000)
    up_P = np.stack([np.sqrt(1 - sines**2) * np.cos(turns), np.sqrt(1 - sines**2) * np.sin(turns), sines], axis=-1)
    lit = np.maximum(up_P @ (dcm_PN @ sun_N / np.linalg.norm(sun_N)), 0)
    season, P2 = np.cos(2 * np.pi * days / 365.25), 1.5 * sines**2 - 0.5
    albedo, emissivity = 0.34 + 0.1 * season * sines + 0.29 * P2, 0.68 - 0.07 * season * sines - 0.18 * P2
    places = np.array([[6.5e6, 3e6, 2e6], [-1e6, -2e6, 7e6], [3e6, -5e6, -5e6], [-2e7, 1e7, 1.2e7]])
    sim = Simulation("earthshine")
    w = sim.world
    w.light = world.Sunlight(sun=world.SUN, shadows=[EARTH], sky=sky)
    w.shine = world.PlanetRadiation(body=EARTH, light=w.light, sky=sky, law="KNOCKE_1988", rings=5)
    w.task("world", every=1e-3 * s, run=[w.light, w.shine])
    for model in (w.light, w.shine):
        sim.feed(model.truth, time=1e-3 * np.arange(4), r_BN_N=places)
    log = sim.record(w.shine.planet, every=1e-3 * s)
    sim.run(3e-3 * s)
    for r_N, reflected, infrared in zip(places, log["reflected_N"], log["infrared_N"]):
        way = R * up_P - dcm_PN @ r_N
        d = np.linalg.norm(way, axis=-1)
        seen = np.maximum(-(way * up_P).sum(axis=-1), 0) / d**4 * R**2 * 4 * np.pi / sines.size / np.pi * E
        wanted = [dcm_PN.T @ (seen[..., None] * way * part[..., None]).sum(axis=(0, 1))
                  for part in (albedo * lit, emissivity / 4)]
        assert np.linalg.norm(reflected - wanted[0]) < 0.01 * 0.3 * E * (R / np.linalg.norm(r_N))**2
        assert np.linalg.norm(infrared - wanted[1]) < 0.005 * np.linalg.norm(wanted[1])


@needs_de405
def test_in_a_sky_the_moon_eclipses_the_sun():
    # The total eclipse of 20 March 2015: greatest at 9:45:39 UT near 64.4 N, 6.6 W.
    sky = world.Sky("2015-03-20T09:46:46", center=EARTH)  # 67 s later: TDB
    station = world.GroundStation(body=EARTH, sky=sky, latitude=64.4 * deg, longitude=-6.6 * deg)
    light = world.Sunlight(sun=world.SUN, shadows=[EARTH, world.MOON], sky=sky, irradiance=1361 * W / m**2)
    craft = world.Spacecraft(I_B=1, gravity=[EARTH], sky=sky, orbit=Orbit(EARTH, a=2e7))
    sim = fly(1, craft=craft, station=station, light=light)
    r = sim.world.station.state.r_PN_N
    sun = sky.state(world.SUN, 1).r_PN_N
    moon = sky.state(world.MOON, 1).r_PN_N
    up = r / np.linalg.norm(r)
    assert np.degrees(np.arcsin(up @ (sun - r) / np.linalg.norm(sun - r))) == pytest.approx(18.5, abs=0.5)
    # A craft right over the ground there, at rest for a moment.
    craft = world.Spacecraft(I_B=1, gravity=[EARTH], sky=sky, r_BN_N=r + 20e3 * up, v_BN_N=[0, 0, 0])
    light = world.Sunlight(sun=world.SUN, shadows=[EARTH, world.MOON], sky=sky)
    dark = fly(1, 100e-3 * s, craft=craft, light=light).world.light.light
    assert dark.visible < 0.01
    # Half the Moon's radius beside the line, the Sun is a crescent; above all of it, whole.
    line = (moon - sun) / np.linalg.norm(moon - sun)
    beside = np.cross(line, [0, 0, 1]) / np.linalg.norm(np.cross(line, [0, 0, 1]))
    craft = world.Spacecraft(I_B=1, gravity=[EARTH], sky=sky, r_BN_N=r + 500e3 * up + 1500e3 * beside, v_BN_N=[0, 0, 0])
    light = world.Sunlight(sun=world.SUN, shadows=[EARTH, world.MOON], sky=sky)
    assert 0.05 < fly(1, 100e-3 * s, craft=craft, light=light).world.light.light.visible < 0.95


@needs_de405
@pytest.mark.parametrize("epoch, centre, l1, l2", [
    ("2017-08-21T18:00:00 TT", (-0.129571, 0.485416), 0.542093, 0.004025),
    ("2024-04-08T18:00:00 TT", (-0.318244, 0.219764), 0.535814, 0.010272)])
def test_the_moons_shadow_has_the_published_besselian_elements(epoch, centre, l1, l2):
    # Espenak: the shadow's axis in the fundamental plane through the Earth's centre, x to the east and y to the north,
    # and the radii of penumbra and umbra there, all in Earth radii, with these radii of the Sun and the Moon.
    R, sun_radius, k1, k2 = 6378137.0, 149597870700 * np.tan(np.radians(959.63 / 3600)), 0.272488, 0.272281
    sky = world.Sky(epoch, center=EARTH)
    z = sky.state(world.SUN).r_PN_N - sky.state(world.MOON).r_PN_N
    x = np.cross(sky.true_of_date()[2], z)
    axes = [axis / np.linalg.norm(axis) for axis in (x, np.cross(z, x))]

    def beyond(radius, k, limit, light_time):
        """How far [m] beyond a radius more of the Sun than `limit` is seen: west, east, south, north."""
        off = np.linspace(-3000, 3000, 121)
        places = [np.multiply(R, centre) + (R * radius + d) * np.array(side)
                  for side in ((-1, 0), (1, 0), (0, -1), (0, 1)) for d in off]
        moon = world.Body("MOON", mu=world.MOON.mu, radius=k * R, naif=301)
        sun = world.Body("SUN", mu=world.SUN.mu, radius=sun_radius, naif=10)
        sim = Simulation("eclipse")
        sim.world.light = light = world.Sunlight(sun=sun, shadows=[moon], sky=sky, light_time=light_time)
        sim.world.task("scan", every=1e-6 * s, run=[light])
        sim.feed(light.truth, time=1e-6 * np.arange(len(places)), r_BN_N=np.array(places) @ axes)
        log = sim.record(light.light, every=1e-6 * s)
        sim.run(1e-6 * (len(places) - 1))
        hidden = log["visible"].reshape(4, -1) <= limit
        return off[np.minimum(hidden.sum(axis=1), 120)]

    assert np.abs(beyond(l1, k1, limit=1 - 1e-9, light_time=1)).max() < 200
    assert np.abs(beyond(l2, k2, limit=0, light_time=1)).max() < 200
    assert np.abs(beyond(l1, k1, limit=1 - 1e-9, light_time=0)).max() > 2900    # the Moon 1.3 s later, 34 km further


@needs_de405
def test_the_world_magnetic_model_in_a_sky():
    sky = world.Sky("2025-01-01", center=EARTH)
    # A published test value at 80 N, 0 E, 100 km: north 6216.0, east 92.4, down 52598.8 nT.
    station = world.GroundStation(body=EARTH, sky=sky, latitude=80 * deg, longitude=0 * deg, altitude=100 * km)
    fly(0, craft=world.Spacecraft(I_B=1, gravity=[EARTH], sky=sky, orbit=Orbit(EARTH, a=2e7)), station=station)
    field = world.Magnetism(body=EARTH, sky=sky, coefficients="WMM2025")
    craft = world.Spacecraft(I_B=1, gravity=[EARTH], sky=sky, r_BN_N=station.state.r_PN_N, v_BN_N=[0, 0, 0])
    sim = fly(0, craft=craft, field=field)
    B_P = sky.orientation(EARTH).dcm_PN @ sim.world.field.field.B_N * 1e9
    lat = 80 * np.pi / 180
    north, up = np.array([-np.sin(lat), 0, np.cos(lat)]), np.array([np.cos(lat), 0, np.sin(lat)])
    assert [B_P @ north, B_P[1], -B_P @ up] == pytest.approx([6216.0, 92.4, 52598.8], abs=0.06)
    assert sim.world.field.coefficients == "WMM2025"
    says("WMM-2025 holds from 2025.0 to 2030.0; the run begins in 2015.", lambda: fly(
        0, craft=world.Spacecraft(I_B=1, gravity=[EARTH], orbit=Orbit(EARTH, a=2e7)),
        field=world.Magnetism(body=EARTH, sky=world.Sky("2015-06-01", center=EARTH), coefficients="WMM")))


# --- errors ----------------------------------------------------------------------------------------

def test_help_has_all_keywords_of_a_model():
    for name, cls in world.TYPES.items():
        if cls.__base__.__name__ == "Model":
            keywords = inspect.signature(cls).parameters
            own = [attribute for attribute, value in vars(cls).items() if isinstance(value, property)]
            assert set(own) <= set(keywords), name
    assert str(inspect.signature(world.Magnetism)) == (
        "(*, dipole_P=0, tolerance=0, spin=0, degree=0, sky=None, body=None, coefficients=None)")


def test_wrong_set_ups_are_refused_before_the_first_step():
    says("world.craft.mass is 0, but one of its parts adds forces", lambda: fly(1, **surroundings(mass=0)))
    models = surroundings()
    models["drag"].areas = [1, 1, 1]
    says("world.drag.normals_B must have a length, found zero at [0]", lambda: fly(1, **models))
    drag = world.Drag(Cd=2, area=1)
    models = surroundings(parts=[drag]) | {"drag": drag}
    del models["solar"], models["gradient"]
    says("world.drag.air is missing: a model of the same world, as in `w.air = world.Atmosphere(...)`",
         lambda: fly(1, **models))
    models = surroundings()
    del models["air"]
    says("world.drag.air is a model outside of the same world", lambda: fly(1, **models))
    models = surroundings()
    del models["drag"]
    says("a part of the spacecraft that asks a world.Atmosphere is itself in no world", lambda: fly(1, **models))
    says("Drag.air: expected a model of air: world.Atmosphere(...), or a prototype with a method air_at",
         lambda: world.Drag(air=models["light"]))
    says("SolarPressure.light: expected a model of the world, as in world.Sunlight(...); found 5",
         lambda: world.SolarPressure(light=5))
    says("Atmosphere.body: expected a body, such as world.MARS", lambda: world.Atmosphere(body=3))
    says("Sunlight.shadows: expected a body", lambda: world.Sunlight(shadows=[5]))
    named = 'Magnetism.coefficients: expected "WMM2025", "IGRF-14" or the path of a .COF file; found '
    says(f"{named}5", lambda: world.Magnetism(coefficients=5))
    says(f"{named}'WMM2020'; did you mean 'WMM2025'?", lambda: world.Magnetism(coefficients="WMM2020"))
    says("world.field.coefficients: ", lambda: fly(1, **{**surroundings(), "field": world.Magnetism(
        body=EARTH, coefficients=__file__, sky=world.Sky("2025-02-01", center=EARTH))}))
    says("world.station.latitude is required", lambda: fly(
        1, **{**surroundings(), "station": world.GroundStation(body=EARTH, longitude=0)}))
    says("world.light.sun is missing", lambda: fly(1, **{**surroundings(), "light": world.Sunlight()}))


@needs_de405
@pytest.mark.parametrize("epoch, center", [("2025-01-01", world.MARS), ("2026-01-01", EARTH)])
def test_a_part_that_asks_in_another_sky_is_refused(epoch, center):
    air = world.Atmosphere(body=EARTH, law="STANDARD_1976", sky=world.Sky(epoch, center=center))
    drag = world.Drag(air=air, Cd=2, area=1)
    craft = world.Spacecraft(mass=1, I_B=1, sky=world.Sky("2025-01-01", center=EARTH), gravity=[EARTH],
                             orbit=Orbit(EARTH, altitude=400 * km), parts=[drag])
    says("world.craft.sky: the Atmosphere that one of its parts asks is in a sky of another center or epoch",
         lambda: fly(1, craft=craft, drag=drag, air=air))

# SPDX-License-Identifier: Apache-2.0
"""The Earth's upper air in missions: place, date and Sun, constant activity, and activity of files."""

import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, world
from fledge.units import K, deg, kg, km, m, s
from tests.needs import needs

pytestmark = needs("casacore-data-jpl-de405")
LAWS = ("NRLMSISE_00", "JB2008", "DTM2000", "MET")
# CelesTrak's form: a date, the eight Kp [tenths] and their sum, the eight ap and their mean, F10.7 and its means.
HEAD = ("DATE,BSRN,ND,KP1,KP2,KP3,KP4,KP5,KP6,KP7,KP8,KP_SUM,AP1,AP2,AP3,AP4,AP5,AP6,AP7,AP8,AP_AVG,CP,C9,ISN,"
        "F10.7_OBS,F10.7_ADJ,F10.7_DATA_TYPE,F10.7_OBS_CENTER81,F10.7_OBS_LAST81,F10.7_ADJ_CENTER81,F10.7_ADJ_LAST81")


def indices(path, storm=()):
    """A file of January to June 2015: F10.7 = 150 and ap = 15, and ap = 300 on the days of a storm."""
    rows = []
    for day in np.arange("2015-01-01", "2015-07-01", dtype="datetime64[D]"):
        kp, ap = ("87", "300") if str(day) in storm else ("30", "15")
        rows.append(",".join([str(day), "2475", "1", *[kp] * 8, str(8 * int(kp)), *[ap] * 9, "0.8", "4", "60",
                              "150.0", "150.0", "OBS", *["150.0"] * 4]))
    path.write_text("\n".join([HEAD, *rows]) + "\n")
    return path


def flown(law, duration=5560 * s, epoch="2015-03-20T12:00:00", **parameters):
    sky = world.Sky(epoch, center=world.EARTH)
    sim = Simulation("air")
    w = sim.world
    w.air = world.EarthAtmosphere(law=law, sky=sky, **parameters)
    w.drag = world.Drag(air=w.air, Cd=2.2, area=1 * m**2)
    w.craft = world.Spacecraft(mass=100 * kg, I_B=1, sky=sky, gravity=[world.EARTH], parts=[w.drag],
                               orbit=Orbit(world.EARTH, altitude=400 * km, i=51 * deg))
    w.connect(w.craft.state >> w.air.truth)
    w.task("world", every=20 * s, run=[w.craft, w.air])
    log = sim.record(w.air.air, w.craft.state)
    sim.run(duration)
    return sim, log


@pytest.mark.parametrize("law", LAWS)
def test_the_air_bulges_after_noon(law):
    sim, log = flown(law, F107=150, ap=15)
    density, r = log["air.density"][1:], np.array(log["craft.state.r_BN_N"])[1:]
    sky = sim.world.craft.sky
    sun = np.array([sky.state(world.SUN, 20.0 * (k + 1)).r_PN_N for k in range(len(r))])
    hours = 12 + np.degrees(np.arctan2(sun[:, 0] * r[:, 1] - sun[:, 1] * r[:, 0],
                                       sun[:, 0] * r[:, 0] + sun[:, 1] * r[:, 1])) / 15
    assert 12.5 < hours[np.argmax(density)] < 16, "in the afternoon"
    assert hours[np.argmin(density)] < 7 or hours[np.argmin(density)] > 22, "in the night"
    # Published figures for moderate activity are 3 to 6e-12 kg/m^3.
    assert 3e-12 < density.mean() < 6e-12
    temperature = log["air.temperature"][1:]
    assert 850 < temperature.min() < temperature.max() < 1300
    assert 0.0145 < log["air.molar_mass"][1:].mean() < 0.0175, "mostly atomic oxygen"


@pytest.mark.parametrize("law", LAWS)
def test_the_northern_summer_is_warmer_in_the_north(law):
    _, log = flown(law, epoch="2015-06-21T12:00:00", F107=150, ap=4)
    north = np.array(log["craft.state.r_BN_N"])[:, 2]
    temperature = log["air.temperature"]
    assert temperature[north > 4e6].mean() > temperature[north < -4e6].mean() + 50


@pytest.mark.parametrize("law", LAWS)
def test_activity_heats_and_factors_scale(law):
    quiet, active, twice = (flown(law, 200 * s, **parameters)[1]["air.density"][-1] for parameters in (
        {"F107": 80, "ap": 4}, {"F107": 200, "ap": 4}, {"F107": 80, "ap": 4, "density_factor": 2}))
    assert active > 3 * quiet and twice == pytest.approx(2 * quiet, rel=1e-12)
    if law == "JB2008":
        stormy = flown(law, 200 * s, F107=80, storm_temperature=300 * K)[1]["air.density"][-1]
    else:
        stormy = flown(law, 200 * s, F107=80, ap=200)[1]["air.density"][-1]
    assert stormy > 1.5 * quiet


@pytest.mark.parametrize("law", ["DTM2000", "MET"])
def test_a_file_of_constant_activity_gives_what_the_parameters_give(law, tmp_path):
    weather = world.SpaceWeather(indices(tmp_path / "SW.csv"))
    by_file, by_numbers = (flown(law, 2000 * s, **parameters)[1]["air.density"] for parameters in (
        {"weather": weather}, {"F107": 150, "ap": 15}))
    np.testing.assert_allclose(by_file[1:], by_numbers[1:], rtol=1e-3)     # ap of Kp 3, and rounding of Kp


def test_a_storm_of_a_file_slows_a_spacecraft_and_clones_go_on_with_it(tmp_path):
    calm, storm = (flown("NRLMSISE_00", 30000 * s, weather=world.SpaceWeather(
        indices(tmp_path / f"{days}.csv", days)))[0] for days in ((), ("2015-03-20",)))
    # A lower orbit is faster: the craft comes ahead.
    r, v = (np.array(getattr(calm.world.craft.state, name)) for name in ("r_BN_N", "v_BN_N"))
    ahead = (np.array(storm.world.craft.state.r_BN_N) - r) @ v / np.linalg.norm(v)
    assert 500 < ahead < 20000
    clone = storm.clone()
    for sim in (storm, clone):
        sim.run(500 * s)
    assert clone.snapshot() == storm.snapshot() and "2015-03-20" in repr(clone.world.air.weather)


def test_what_is_missing_or_given_twice_is_refused(tmp_path):
    weather = world.SpaceWeather(indices(tmp_path / "SW.csv"))

    def says(words, **parameters):
        with pytest.raises(SetupError, match=words):
            flown(parameters.pop("law", "MET"), parameters.pop("duration", 60 * s), **parameters)

    says(r"world.air.F107 must be > 0, or weather=world.SpaceWeather\(.*\) has the activity; found 0")
    says("world.air.ap: `weather` has the activity; found 4 besides: leave one of both out", weather=weather, ap=4)
    says("EarthAtmosphere.weather: expected world.SpaceWeather\\(file\\); found 5", weather=5)
    says("world.air.weather: .*SW.csv", weather=weather, epoch="2016-01-01")
    says("world.air.weather: .*SW.csv", weather=weather, law="JB2008")
    with pytest.raises(SetupError, match="world.air.sky is missing: it says the date and where the Sun is"):
        sim = Simulation("bare")
        sim.world.air, sim.world.craft = world.EarthAtmosphere(F107=100), world.Spacecraft(I_B=1)
        sim.world.connect(sim.world.craft.state >> sim.world.air.truth)
        sim.world.task("world", every=1 * s, run=[sim.world.craft, sim.world.air])
        sim.run(1 * s)
    (tmp_path / "bad.csv").write_text(f"{HEAD}\n2015-01-01,x\n")
    with pytest.raises(SetupError, match="bad.csv:2: "):
        world.SpaceWeather(tmp_path / "bad.csv")
    with pytest.raises(SetupError, match="nowhere.csv: "):
        world.SpaceWeather(tmp_path / "nowhere.csv")
    with pytest.raises(SetupError, match="SpaceWeather: files: expected the path of a file; found 5"):
        world.SpaceWeather(5)

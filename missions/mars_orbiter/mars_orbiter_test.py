# SPDX-License-Identifier: Apache-2.0
"""The orbiter's tests on the desktop, and that each target flies and says the same through the four boards."""
import os
from pathlib import Path

import pytest
from numpy import arcsin, array, cos, cross, pi, sin, sqrt
from numpy.linalg import norm

import fledge
from fledge import Orbit, cli, world
from fledge.commands import decoded
from fledge.units import minute
from missions.mars_orbiter.mission import DATE
from missions.mars_orbiter.scenarios import FAILS, converter_fails, sun_faults, sun_off
from missions.mars_orbiter.vehicle import PLACE
from tests.circles import long_after
from tests.needs import skip_unless_on

BOARDS = Path(__file__).with_name("boards")


@pytest.mark.parametrize("scenario", ["safe", "pointing", "sun_sensors"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("mars_orbiter")
    sim.plots = False
    sim.scenarios[scenario]()


@pytest.mark.parametrize("kind", ["HIGH", "LOW", "BABBLE"])
@pytest.mark.parametrize("channels", long_after(1, [0b1111, 0b0010], "flies again"), ids=["all", "one"])
@pytest.mark.parametrize("which", long_after(1, ["a", "b"], "flies again"))
def test_the_protection_names_the_faulty_converter(which, channels, kind):
    sim = fledge.load("mars_orbiter")
    sim.plots = False
    converter_fails(sim, which, kind, channels)


def fault(kind, channels=0b1111, **more):
    return [{"kind": kind, "channels": channels, **more}]


def blinks(on, every):
    """Sensor 2 of pyramid B is high for so long [s] in each of these times."""
    return {t + after: {"b": state} for t in range(0, 200, every) for after, state in ((0, fault("HIGH", 2)), (on, []))}


def drifts(which, channels, rate):
    return {0: {which: fault("DRIFT", channels, size=rate, begin=FAILS)}}


def flown(changes, lasts=5 * minute, **fields):
    """(log, the events of pyramids and protection, with their times [s] after FAILS, flight)"""
    sim = fledge.load("mars_orbiter")
    truth = sim.process("world")
    for path, value in fields.items():
        name, field = path.split("_", 1)
        setattr(getattr(truth, name), field, value)
    commands = sim.flight.commands
    commands.take_packets()
    log = sun_faults(sim, changes, lasts)
    decoded_packets = [decoded(commands.dictionary, packet.packet) for packet in commands.take_packets()]
    events = [p.content for p in decoded_packets if p.path == "events" and p.content.t > FAILS.value * 1e9]
    assert sim.flight.active_mode == "safe"
    return log, {(e.output.split(".")[1], e.name): e.t / 1e9 - FAILS.value for e in reversed(events)}, sim.flight


@pytest.mark.long("flies minutes of the orbiter for each")
@pytest.mark.parametrize("changes, off", [
    ({}, 0.002), (blinks(2, 20), 0.002), ({0: {"a": fault("BABBLE")}, 2: {"a": []}}, 0.002)],
    ids=["nothing", "now and then", "clears at once"])
def test_no_sensor_is_blamed(changes, off):
    log, events, _ = flown(changes)
    assert not log["status.faulty"].any() and not log["table.faulted"].any() and not events
    assert sun_off(log).max() < off


@pytest.mark.long("flies minutes of the orbiter for each")
@pytest.mark.parametrize("changes, off", [
    *(({0: {"a": fault(kind), "b": fault(kind)}}, 0.01) for kind in ("HIGH", "BABBLE")),
    ({0: {"a": fault("HIGH", 2), "b": fault("HIGH", 4)}}, 0.01),
    (drifts("a", 2, 1), 0.01), (drifts("a", 15, 0.2), 0.06)],
    ids=["both high", "both babble", "one of each", "one drifts", "all of one drift"])
def test_what_may_be_of_either_is_reported_and_the_gyro_holds_the_sun(changes, off):
    log, events, _ = flown(changes)
    assert not log["status.faulty"].any() and not log["table.faulted"].any()
    assert list(events) == [("pyramids", "UNRESOLVED")] and events["pyramids", "UNRESOLVED"] < 140
    assert sun_off(log).max() < off


@pytest.mark.long("flies minutes of the orbiter for each")
@pytest.mark.parametrize("which, changes, within, fields", [
    ("b", blinks(3, 5), 10, {}),
    ("a", {0: {"a": fault("BABBLE")}, 60: {"a": []}}, 10, {}),
    ("a", drifts("a", 1, 1), 135, {}),
    ("a", {1: {"a": fault("BABBLE")}}, 10, {"power_reset_at": [FAILS.value, 0, 0, 0]}),
    ("b", {1: {"b": fault("BABBLE")}}, 10, {"power_reset_at": [FAILS.value, 0, 0, 0]}),
    ("a", {-20: {"a": fault("BABBLE")}}, 10, {"power_reset_at": [FAILS.value, 0, 0, 0]})],
    ids=["intermittent", "clears", "a dark one drifts", "a in a reset", "b in a reset", "before a reset"])
def test_the_right_one_is_named_and_stays_out(which, changes, within, fields):
    log, events, f = flown(changes, **fields)
    assert log["status.faulty"][-1] == f.pyramids.status.faulty == "ab".index(which) + 1
    assert set(log["status.faulty"]) == {0, "ab".index(which) + 1}
    assert int(log["table.faulted"][-1]) == 1 << PLACE[f"converter {which}"]
    assert events["pyramids", "FAULTY"] < within and sun_off(log).max() < 0.002


def test_an_eclipse_blames_no_sensor_and_the_gyro_holds_the_sun():
    """41 minutes in the shadow of Mars, 600 km above it, in a plane with the Sun."""
    sky = world.Sky(DATE, center=world.MARS)
    sun = array(sky.state(world.SUN, 0).r_PN_N)
    u, side = sun / norm(sun), cross(sun, [0, 0, 1]) / norm(cross(sun, [0, 0, 1]))
    radius = world.MARS.radius + 600e3
    speed = sqrt(world.MARS.mu / radius)
    angle = pi - arcsin(world.MARS.radius / radius) - speed / radius * FAILS.value     # it enters the shadow at FAILS
    orbit = Orbit.from_state(world.MARS, radius * (cos(angle) * u + sin(angle) * side),
                             speed * (cos(angle) * side - sin(angle) * u))
    log, events, f = flown({}, 60 * minute, craft_orbit=orbit)
    dark = log["adc_a.counts.counts"].max(axis=1) < 20
    assert 38 * 60 < dark.sum() < 44 * 60
    assert not log["status.faulty"].any() and not log["table.faulted"].any()
    assert "pyramids" not in {output for output, _ in events}
    assert sun_off(log).max() < 0.03 and sun_off(log)[-1] < 1e-3


@pytest.mark.long("builds and flies the orbiter on targets: 200 s")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
@pytest.mark.parametrize("scenario, target", [
    *(("pointing", target) for target in ("linux", "cfs", "leon3", "leon3-cfs", "micropython")),
    ("sun_sensors", "linux"), ("insertion", "linux")])
def test_a_target_flies_and_says_what_the_desktop_does(scenario, target, tmp_path, capsys):
    skip_unless_on(target)
    arguments = ["fly", "mars_orbiter", scenario, "--on", target, "--board", str(BOARDS), "--out", str(tmp_path)]
    assert cli.main(arguments) == 0, capsys.readouterr()

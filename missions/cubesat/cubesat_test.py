# SPDX-License-Identifier: Apache-2.0
"""The CubeSat as numbers: with and without star trackers, with three wheels and four, commanded by radio."""
import json
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import cli, ground
from fledge import flight as fsw
from fledge.attitude import angle, relative
from fledge.errors import SetupError
from fledge.units import T, deg, minute, s
from tests.circles import long_after


def flown(name, **options):
    sim = fledge.load("cubesat", **options)
    sim.plots = False
    sim.scenarios[name]()


def slow(**options):
    """A CubeSat whose tumble has ended."""
    sim = fledge.load("cubesat", **options)
    sim.world.craft.omega_BN_B = [0.2, -0.5, 0.3] * deg / s
    sim.flight.start_in("brake")
    return sim


@pytest.mark.parametrize("name", long_after(2, ["imaging", "blinded", "release", "without_gps", "crippled"],
                                            "flies hours"))
def test_the_scenarios_pass(name):
    flown(name)


@pytest.mark.parametrize("name, options", long_after(2, [
    ("imaging", {"trackers": 1, "wheels": 3}), ("imaging", {"trackers": 0}), ("blinded", {"trackers": 0}),
    ("crippled", {"wheels": 3})], "flies hours"))
def test_with_fewer_units_it_does(name, options):
    flown(name, **options)


def test_without_star_trackers_it_finds_the_sun_and_looks_down():
    sim = slow(trackers=0)
    craft = sim.world.craft
    sim.run(5 * minute)
    ground.connect(sim).command("mode", "nadir").completed(within=10 * s)
    sim.run(4 * minute)
    down = -craft.state.r_BN_N / np.linalg.norm(craft.state.r_BN_N)
    camera = fledge.attitude.mrp_to_dcm(np.array(craft.state.sigma_BN))[2]
    assert sim.mode == "nadir" and np.degrees(np.arccos(camera @ down)) < 2


def test_nadir_is_refused_before_the_attitude_is_known():
    sim = fledge.load("cubesat")
    craft = ground.connect(sim)
    sim.run(1 * s)
    with pytest.raises(ground.NoAnswer, match="nadir is entered only if"):
        craft.command("mode", "nadir").completed(within=10 * s)


def test_a_pass_is_commanded_by_radio():
    """From below the horizon a command is lost; in the pass it arrives, and telemetry comes back."""
    sim = slow()
    craft = ground.connect(sim, radio=sim.world.radio)
    early = craft.command("mode", "nadir")
    sim.run(17 * minute)
    assert not early.reports and sim.mode == "sun"
    while not sim.world.radio.up.lock:
        sim.run(5 * s)
    craft.command("mode", "nadir").completed(within=10 * s)
    craft.command("telemetry", "flight.orbit.orbit").completed(within=10 * s)
    craft.listen(20 * s)
    assert np.linalg.norm(np.array(craft.telemetry.flight.orbit.orbit.r_BN_N) - sim.world.craft.state.r_BN_N) < 2e6
    assert sim.mode == "contact"


def test_a_magnetometer_that_is_stuck_leaves_no_wrong_attitude_that_is_good():
    sim = slow(trackers=0)
    f, w = sim.flight, sim.world
    w.tam.faults = [{"kind": "HIGH", "size": 3e-5 * T, "begin": 20 * minute}]
    log = sim.record(w.craft.state, f.vectors.attitude, every=4 * s)
    sim.run(5 * minute)
    ground.connect(sim).command("mode", "nadir").completed(within=10 * s)
    sim.run(90 * minute)
    off = angle(relative(log["vectors.attitude.sigma_BN"], log["craft.state.sigma_BN"]))
    good = log["vectors.attitude.head.quality"] == fsw.Quality.GOOD
    assert good[log.time < 1200].mean() > 0.9 and not good[-1], "it never doubts"
    assert np.degrees(off[good].max()) < 3 and sim.mode == "sun"


@pytest.mark.parametrize("options", [{"trackers": -1}, {"trackers": 3}, {"wheels": 2}, {"trackers": 0.5}])
def test_other_numbers_of_star_trackers_and_wheels_are_refused(options):
    with pytest.raises(SetupError, match="expected 0, 1 or 2 star trackers, and 3 or 4 wheels; found"):
        fledge.load("cubesat", **options)


def test_a_script_of_the_ground_meets_it_after_its_release(tmp_path):
    script = Path(__file__).with_name("first_contact.py")
    assert cli.main(["ground", "run", str(script), "--to", "cubesat", "--yes", "--out", str(tmp_path)]) == 0
    rows = [json.loads(line) for line in (tmp_path / "script.jsonl").read_text().splitlines()]
    assert [row["good"] for row in rows if row["kind"] == "check"] == [True] * 3

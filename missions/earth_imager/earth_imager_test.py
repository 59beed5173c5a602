# SPDX-License-Identifier: Apache-2.0
"""The Earth imager as numbers."""

import json
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.requirements import Requirements
from fledge.units import minute, s


@pytest.mark.parametrize("scenario", ["handover", "seized_wheel", "contact"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("earth_imager")
    sim.plots = False
    sim.scenarios[scenario]()


def test_its_contact_is_as_required_and_each_requirement_can_fail():
    sim = fledge.load("earth_imager")
    sim.plots = False
    watch = Requirements(sim).watch()
    sim.scenarios["contact"]()
    assert [outcome.verdict for outcome in watch.outcomes()] == ["holds"] * 4

    sim = fledge.load("earth_imager")
    sim.world.wheels.faults = [{"kind": "DEAD", "channels": 0b1111, "begin": 0 * s}]
    watch = Requirements(sim).watch()
    sim.flight.commands.telemetry("flight.tracking.error", every=2)     # no radio brings it
    sim.flight.commands.telemetry("housekeeping")
    sim.run(4 * minute)
    assert [outcome.verdict for outcome in watch.outcomes()] == ["violated"] * 4


def test_flight_knows_how_the_earth_stands_and_turns():
    """Over the whole run, the station that flight computes is the world's to a few centimetres."""
    sim = fledge.load("earth_imager")
    log = sim.record(sim.flight.station.target, sim.world.station.state, every=60 * s)
    sim.run(35 * minute)
    off = np.linalg.norm(log["target.r_PN_N"] - log["state.r_PN_N"], axis=1)
    assert off.max() < 0.1


def test_the_slew_keeps_to_its_rate():
    sim = fledge.load("earth_imager")
    log = sim.record(sim.flight.tracking.error, sim.flight.station.contact, every=0.5 * s)
    sim.run(30 * minute)
    late = log.time > 120
    rates = np.degrees(np.abs(log["error.omega_BR_B"][late]))
    assert 1.0 < rates.max() < 1.55     # steering's limit is 1.5 about each axis


def test_a_dead_motor_shows_when_it_is_needed_and_three_wheels_go_on():
    sim = fledge.load("earth_imager")
    sim.world.wheels.faults = [{"kind": "DEAD", "channels": 0b0010, "begin": 8 * minute}]
    f = sim.flight
    log = sim.record(f.monitor.availability, f.station.contact, f.tracking.error, every=1 * s)
    sim.run(25 * minute)
    used, rises = log["availability.available"][:, 1] == 1, log.time[log["contact.visible"] == 1].min()
    assert used[log.time < rises].all() and not used[log.time > rises + 20].any()
    assert (log["availability.available"][-1][:4] == [1, 0, 1, 1]).all()
    assert 4 * np.linalg.norm(log["error.sigma_BR"][-1]) < 2e-3


def test_without_the_monitor_the_seized_wheel_spoils_the_pass():
    sim = fledge.load("earth_imager")
    sim.plots = False
    sim.flight.monitor.on = 0b1111
    with pytest.raises(AssertionError, match="the seized wheel is in use"):
        sim.scenarios["seized_wheel"]()


def test_a_script_of_the_ground_takes_each_wheel_out_of_use(tmp_path):
    script = Path(__file__).with_name("commission.py")
    assert cli.main(["ground", "run", str(script), "--to", "earth_imager", "--yes", "--out", str(tmp_path)]) == 0
    rows = [json.loads(line) for line in (tmp_path / "script.jsonl").read_text().splitlines()]
    assert [row["good"] for row in rows if row["kind"] == "check"] == [True] * 5

# SPDX-License-Identifier: Apache-2.0
"""A scenario judges what a target put out: its checks see the target's data, and the world that these drove."""

import shutil

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.commands import Timed
from fledge.errors import Failure
from fledge.export.run_test import FLIGHT, WORLD
from fledge.records.activity import facts, happenings, modes
from fledge.targets import build
from fledge.targets.playback import stand_in
from fledge.targets.linux import Linux
from fledge.units import minute

NADIR_SPIN = build.ROOT / "missions/nadir_spin"


def every_output(sim, process="flight"):
    names = [module for task in sim.process(process).tasks for module in task.run]
    return [port for name in names for port in (sim.process(process).instances[name],)]


PLAYS = '''
from fledge.units import N, m, minute, s

def changes(sim):
    """What it asks of flight between its runs."""
    f, w = sim.flight, sim.world
    sim.run(1 * minute)
    f.enter("point")
    f.control.K = 3 * N * m
    f.vehicle.I_B = [700, 700, 801]
    sim.run(4 * minute)
    f.settled.armed = False
    f.rest.enter()
    sim.run(1 * minute)
'''


def test_modes_parameters_and_events_change_nothing_in_a_flight_that_stands_in(tmp_path):
    mission = tmp_path / "plays"
    mission.mkdir()
    for name, text in (("flight.py", FLIGHT), ("world.py", WORLD), ("scenarios.py", PLAYS)):
        (mission / name).write_text(text)
    elsewhere = fledge.load(str(mission))
    elsewhere.record(*every_output(elsewhere), *elsewhere.world, every=0)
    elsewhere.archive(tmp_path / "elsewhere.mcap")
    elsewhere.scenarios["changes"]()
    elsewhere.close_archive()
    record = Archive(tmp_path / "elsewhere.mcap")

    again = fledge.load(str(mission))
    stand_in(again, {"flight": record})
    again.record(*every_output(again), *again.world, every=0)
    again.archive(tmp_path / "again.mcap")
    again.flight.control.K = 77.0
    again.flight.start_in("rest")
    again.scenarios["changes"]()
    again.close_archive()

    def both(times):    # the playback has the instants of all modes
        return np.isin(times, record.time_ns("control.torque"))
    assert not [d for d in compare(record, Archive(tmp_path / "again.mcap"), times=both) if d.count]
    assert again.mode == elsewhere.mode == "rest"
    with pytest.raises(fledge.SetupError, match="has run until 360 s"):
        stand_in(again, {"flight": record})


def test_its_modes_and_what_happened_are_those_of_the_record(tmp_path):
    """Whatever this program asks for, and whatever its own events would do."""
    mission = tmp_path / "plays"
    mission.mkdir()
    for name, text in (("flight.py", FLIGHT), ("world.py", WORLD)):
        (mission / name).write_text(text)

    def flown(name, after=None):
        sim = fledge.load(str(mission))
        if after:
            stand_in(sim, {"flight": Archive(after)})
            sim.flight.start_in("rest")
            sim.flight.settled.armed = sim.flight.off.armed = False
        sim.record(*every_output(sim))
        sim.archive(tmp_path / name)
        for mode in ("rest" if after else "point", "wait"):
            sim.run(3 * minute)
            sim.flight.enter(mode)
        sim.run(3 * minute)
        sim.close_archive()
        return sim, tmp_path / name

    there, record = flown("there.mcap")
    here, again = flown("here.mcap", record)
    assert compare(Archive(record), Archive(again), ["/flight/mode", "/flight/activity"]) == []
    assert len(modes(there.activity)["flight"]) > 3 and len(happenings(there.activity)) > 6
    for what in (modes, happenings, facts):
        assert what(here if what is facts else here.activity) == what(there if what is facts else there.activity)
    assert here.flight.active_mode == there.flight.active_mode == modes(there.activity)["flight"][-1][1]
    snapshot = here.clone()
    snapshot.run(1 * minute)
    assert snapshot.flight.active_mode == here.flight.active_mode

    lacking = Altered(Archive(record), "", "")
    lacking.topics = {name: topic for name, topic in lacking.topics.items() if name != "/flight/mode"}
    with pytest.raises(Failure, match="it has no /flight/mode, so flight cannot be judged by it"):
        stand_in(fledge.load(str(mission)), {"flight": lacking})


class Altered:
    """A record in which one field has the other sign."""

    def __init__(self, archive, topic, field):
        self.archive, self.altered = archive, (topic, field)
        self.topics, self.path, self.time_ns = archive.topics, archive.path, archive.time_ns

    def __getitem__(self, topic):
        values = self.archive[topic]
        if topic == self.altered[0]:
            values = values.copy()
            values[self.altered[1]] *= -1
        return values


@pytest.mark.long("builds and flies on a target")
def test_the_checks_of_a_scenario_judge_the_record(tmp_path, capsys):
    """A whole flight on a target passes by its own data, with the page and plots of a run, and the world that it drove
    is the one that it flew in; the same record with the other sign of the torques fails."""
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--out", str(tmp_path), "--report"]) == 0
    out = capsys.readouterr().out
    assert "  passed   desktop, linux\n" in out
    page = (tmp_path / "linux_run/report.html").read_text()
    assert "passed" in page and "spin, on linux" in page and "./fledge fly nadir_spin --on linux --out" in page
    assert (tmp_path / "linux_run/nadir_spin.png").is_file()
    assert cli.main(["run", "nadir_spin", "--out", str(tmp_path / "run"), "--no-plots"]) == 0
    assert compare(*(Archive(tmp_path / name / "run.mcap") for name in ("run", "linux_run"))) == []

    sim = fledge.load("nadir_spin")
    sim.plots = False
    altered = Altered(Archive(tmp_path / "linux.mcap"), "/flight/motor/command", "u")
    stand_in(sim, {"flight": altered})
    with pytest.raises(AssertionError, match="the boresight is off nadir"):
        sim.scenarios["spin"]()
    # Only the boresight is of the world's truth; the other checks look at flight's own outputs, which are the same.

    lacking = Altered(altered.archive, "", "")
    lacking.topics = {name: topic for name, topic in lacking.topics.items() if name != "/flight/motor/command"}
    with pytest.raises(Failure, match=r"linux.mcap: it has no /flight/motor/command, so flight cannot be judged"):
        stand_in(fledge.load("nadir_spin"), {"flight": lacking})

    sim, packets, received = fledge.load("nadir_spin"), [Timed(-1, b"first"), Timed(2 * 10**9, b"second")], []
    stand_in(sim, {"flight": altered.archive}, packets={"flight": packets})
    sim.flight.commands.noop()                          # whose reports no ground gets: they are not the flight's
    for end in (1.5, 2.0, 3.0):
        sim.run(until=end)
        received.append(sim.flight.commands.take_packets())
    assert received == [packets[:1], packets[1:], []]


@pytest.mark.long("builds a target with another gain")
def test_a_target_that_flies_badly_fails_the_scenario(tmp_path, capsys, monkeypatch):
    """Its checks are reported beside a requirement that it violates, as the desktop does."""
    real, mission = Linux.build, tmp_path / "nadir_spin"
    shutil.copytree(NADIR_SPIN, mission)
    (mission / "requirements.py").write_text(
        "from fledge.requirements import always\n\n\ndef rate(r):\n    r.require('RATE-1', 'It never turns.', always("
        "r.signal('flight.tracking.error.omega_BR_B').norm() < 1e-9))\n")

    def spoiled(self, job):
        source = next(path for path in job.written if path.name == "nadir_spin.c")
        text = source.read_text()
        source.write_text(text.replace(" = 45.0;", " = 0.5;"))
        assert source.read_text() != text
        return real(self, job)

    monkeypatch.setattr(Linux, "build", spoiled)
    assert cli.main(["fly", str(mission), "--on", "linux", "--out", str(tmp_path / "out")]) == 1
    captured = capsys.readouterr()
    assert "fledge: nadir_spin, spin on linux: failed: " in captured.err
    assert "the attitude did not settle" in captured.err
    assert captured.out.endswith(
        "  failed   desktop: violates RATE-1; linux: differs from the desktop, violates RATE-1, "
        "the scenario's checks do not hold\n")


@pytest.mark.long("flies another part on a target")
def test_a_part_of_a_scenario_is_not_judged(tmp_path, capsys):
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--for", "20s", "--out", str(tmp_path)]) == 0
    assert "  checks   none: the flight ends before the scenario spin\n" in capsys.readouterr().out


@pytest.mark.long("builds and flies a board")
def test_behind_boards_that_round_the_world_is_the_one_that_was_flown(tmp_path):
    """What the world reads is what the board made of it, to the bit: so its state is that of the flight."""
    mission = tmp_path / "short"
    shutil.copytree(NADIR_SPIN, mission)
    scenarios = mission / "scenarios.py"
    scenarios.write_text("def short(sim):\n    sim.run(300)\n")
    out = tmp_path / "out"
    assert cli.main(["fly", str(mission), "--on", "linux", "--board", str(mission / "converters.toml"), "--out",
                     str(out)]) == 0
    exchange = Archive(out / "linux.exchange.mcap")
    seen = [topic for topic in exchange.topics if topic.startswith("/world/")]
    assert len(seen) == 3

    def worlds(exchange):
        sim = fledge.load(str(mission))
        stand_in(sim, {"flight": Archive(out / "linux.mcap")}, exchange)
        sim.record(sim.world.nav.attitude, sim.world.nav.orbit, sim.world.wheels.speeds, every=0.1)
        sim.archive(tmp_path / "again.mcap")
        sim.run(300.0)
        sim.close_archive()
        return Archive(tmp_path / "again.mcap")

    def flown(times):
        return np.isin(times, exchange.time_ns(seen[0]))
    assert compare(exchange, worlds(exchange), seen, times=flown) == []
    assert compare(exchange, worlds(None), seen, times=flown) != []     # without the board, another world

# SPDX-License-Identifier: Apache-2.0
"""`fledge node`: one process, several, and all with the controller; and that nothing of them stays behind."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import fledge
from fledge import cli, cosim
from fledge.archive import Archive
from fledge.cli.cosim.node import _single, _second_run, set_up
from tests.waiting import wait_for

ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("FLEDGE_NODE")} | {
    "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def command(*arguments):
    return [sys.executable, "-m", "fledge.cli", *map(str, arguments)]


def fledge_(*arguments, code=0):
    """Run the command line; returns its output."""
    done = subprocess.run(command(*arguments), capture_output=True, text=True, env=ENVIRONMENT)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


class Group:
    """A command in a session of its own, all of which ends with the test."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        text=True, env=ENVIRONMENT, start_new_session=True)

    def members(self):
        flown = []
        for status in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = status.read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == self.process.pid and fields[0] != "Z":
                flown.append(int(status.parent.name))
        return flown

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for pid in self.members():
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        self.process.wait()
        self.process.stdout.close()


def test_all_processes_write_what_the_run_in_one_writes(tmp_path):
    # Records of the same times: the world's instants are not flight's, so every second.
    text = fledge_("node", "inertial_pointing", "all", "--until", "20min", "--seed", 4, "--record", tmp_path / "apart")
    assert "2 programs, world, flight" in text and "record   2 in" in text
    fledge_("run", "inertial_pointing", "--seed", 4, "--no-plots", "--out", tmp_path / "one")
    whole, apart = Archive(tmp_path / "one/run.mcap"), {}
    for name in ("flight", "world"):
        archive = Archive(tmp_path / f"apart/{name}.mcap")
        assert archive.complete and archive.metadata["run"]["seed"] == "4"
        assert archive.metadata["run"]["process"] == name and archive.metadata["end"]["outcome"] == "passed"
        apart.update((topic, archive) for topic in archive.topics)
    assert sorted(apart) == sorted(whole.topics) and len(apart) == 6
    for topic, archive in apart.items():
        assert archive.time(topic).tobytes() == whole.time(topic).tobytes()
        assert archive[topic].tobytes() == whole[topic].tobytes(), topic


def test_the_time_of_each_node_is_the_end_of_the_run(tmp_path):
    # No task of either process runs at 10.27 s.
    fledge_("node", "inertial_pointing", "all", "--free", "--until", "10.27s", "--record", tmp_path)
    for process in ("world", "flight"):
        assert Archive(tmp_path / f"{process}.mcap").metadata["end"] == {
            "outcome": "passed", "ended": "10.27 s"}


@pytest.mark.long("kills each process in turn")
@pytest.mark.parametrize("which", ["the command", "a program of it"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_nothing_stays_behind(which, number):
    with Group("node", "constellation", "all", "--until", "1000h", "--set", "spacecraft=2") as group:
        wait_for(lambda: len(group.members()) >= 5, group.process)
        programs = [pid for pid in group.members() if pid != group.process.pid]
        os.kill(group.process.pid if which == "the command" else programs[0], number)
        assert group.process.wait() in ((-9, 130) if which == "the command" else (1,))
        output = group.process.stdout.read()
        assert which == "the command" or output.count("\n") <= 3 and "sat" in output, output
        wait_for(lambda: not group.members())


@pytest.mark.long("waits for a limit of time")
def test_a_program_that_comes_after_the_end_adds_no_lines():
    with Group("node", "constellation", "all", "--until", "1000h", "--set", "spacecraft=2") as group:
        wait_for(lambda: len(group.members()) >= 5, group.process)
        first, *_, late = sorted(pid for pid in group.members() if pid != group.process.pid)
        os.kill(late, signal.SIGSTOP)
        wait_for(lambda: Path(f"/proc/{late}/stat").read_text().rpartition(")")[2].split()[0] == "T")
        os.kill(first, signal.SIGKILL)
        wait_for(lambda: set(group.members()) == {group.process.pid, late})
        os.kill(late, signal.SIGCONT)
        assert group.process.wait() == 1
        output = group.process.stdout.read()
        assert output.count("\n") == 2 and output.count("sat0_world") == 2, output


def test_ctrl_c_leaves_readable_records(tmp_path):
    with Group("node", "inertial_pointing", "all", "--until", "1000h", "--record", tmp_path) as group:
        wait_for(lambda: len(list(tmp_path.glob("*.part"))) == 2, group.process)
        os.killpg(group.process.pid, signal.SIGINT)
        assert group.process.wait() == 130
    for name in ("world", "flight"):
        archive = Archive(tmp_path / f"{name}.mcap")
        assert archive.complete and archive.metadata["end"]["outcome"] != "passed"


@pytest.mark.parametrize("arguments, says", [
    (["nadir_spin", "ground"], "nadir_spin has no process 'ground'; it has world, flight"),
    (["nadir_spin", "flight,ground"], "nadir_spin has no process 'ground'"),
    (["nadir_spin", "all", "--name", "one"], "--name is for one process"),
    (["nadir_spin", "world", "--script", "x"], "--script is for one flight process"),
    (["nadir_spin", "flight", "--script", __file__], "expected lines of a time [ns] and hexadecimal"),
    (["nadir_spin", "flight", "--seed", 3], "the seed is the controller's to give"),
    (["nadir_spin", "all", "--until", "soon"], "--until: expected a duration such as 90s, 10min or 2h; found 'soon'"),
    (["nadir_spin", "flight", "spni"], "nadir_spin has no scenario 'spni'; did you mean 'spin'? it has spin"),
    (["nadir_spin", "flight", "spin", "--free"], "give a scenario or --free, not both"),
    (["nadir_spin", "flight", "--set", "speed"], "--set speed: expected NAME=VALUE"),
    (["nadir_spin", "flight", "--set", "speed=3"], "the mission nadir_spin has no parameter 'speed'; it has none"),
    (["nadir_spin", "flight", "--set", "rate=1degs"], "--set rate=1degs: expected a number without a unit, in the unit "
                                                      "that the mission gives rate; found '1degs'"),
    (["nadir_spin", "flight", "--set", "rate=0.3 deg/s"], "found '0.3 deg/s'"),
    (["nadir_spin", "flight", "--set", "date=2015-03-02T12"], "has no parameter 'date'"),
    (["nadir_spin", "flight", "--set", "size='3U'"], "has no parameter 'size'"),
    (["single_spiral", "flight"], "runs again here, and what it does between its runs cannot be done"),
    (["single_spiral", "flight"], "--free, in the file of a run free = true in each [[node]]"),
    (["nadir_spin", "flight", "--keys", "nowhere"], "nowhere"),
])
def test_wrong_commands(arguments, says, capsys):
    before = signal.getsignal(signal.SIGTERM)
    try:
        assert cli.main(["node", *map(str, arguments)]) == 2
    finally:
        signal.signal(signal.SIGTERM, before)
    assert says in capsys.readouterr().err


def test_a_scenario_s_set_up_is_done_and_its_run_is_not():
    sim = fledge.load("asterisk_scan")
    before = sim.flight.rasters.angles.copy()
    assert set_up(sim, "wide") == "wide"
    assert (sim.flight.rasters.angles != before).any() and len(sim.records) == 7
    assert sim.time_ns == -1 and callable(sim.run)
    sim = fledge.load("asterisk_scan")
    assert set_up(sim, free=True) == "free" and len(sim.records) > 7


def test_a_node_keeps_no_samples_in_memory(tmp_path, monkeypatch):
    sim = fledge.load("inertial_pointing")
    scenario = set_up(sim)
    monkeypatch.setattr(cosim, "split", lambda sim, *_: SimpleNamespace(serve=lambda *_, **__: sim.run(60.0) or ""))
    options = SimpleNamespace(name=None, fmu=None, record=str(tmp_path), address=None, simulation=None, keys=None,
                              patience=1.0, delay=0.0, until=None, outputs=None, script=None)
    assert _single(sim, scenario, "world", options) == 0
    assert sim.records and sum(map(len, sim.records)) == 0
    archive = Archive(tmp_path / "world.mcap")
    assert archive.topics and all(channel.count > 1 for channel in archive.topics.values())


def test_a_second_run_is_found():
    for name, twice in (("nadir_spin", {"spin": False}), ("single_spiral", {"spiral": True}),
                        ("two_body_pointing", {"earth_and_sun": False, "near_conjunction": True})):
        scenarios = fledge.load(name).mission.scenarios
        assert {scenario: _second_run(function) is not None for scenario, function in scenarios.items()} == twice
    file, line = _second_run(scenarios["near_conjunction"])
    assert "sim.run(60" in Path(file).read_text().splitlines()[line - 1]

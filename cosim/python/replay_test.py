# SPDX-License-Identifier: Apache-2.0
"""The controller's program records an exchange. Each node alone repeats its run against this record; the first
difference is reported with its message, field and time."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fledge.archive import ArchiveError
from fledge.cli import main
from fledge.cosim.replay import Exchange, replay

ROOT = Path(__file__).resolve().parents[2]
NODE = [sys.executable, "-m", "fledge.cli", "node", "nadir_spin"]
CHANGED = """
import fledge
from fledge import cosim
sim = fledge.load("nadir_spin")
sim.flight.control.K = 2.0
cosim.split(sim, "flight").serve()
"""

PATHS = os.pathsep.join(os.path.abspath(p) for p in sys.path)


@pytest.fixture(autouse=True)
def paths(monkeypatch):
    """Programs started here find Fledge where this one does, and missions where they are."""
    monkeypatch.setenv("PYTHONPATH", PATHS)
    monkeypatch.chdir(ROOT)


def build():
    """The build tree that the extension comes from."""
    from fledge.disk import build_folder

    return build_folder()


def controller(folder, until, *nodes):
    """Start the controller's program; returns it and its address."""
    address = f"ipc://@fledge-replay-test-{os.getpid()}-{folder.name}"
    command = [build() / "cosim/fledge_controller", "--simulation", "nadir_spin", "--until", str(until), "--address",
               address, "--seed", "7", "--record", folder / "exchange.mcap"]
    for node in nodes:
        command += ["--node", node]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL), address


def start(process, address, command=NODE):
    return subprocess.Popen([*command, process], env=os.environ | {"FLEDGE_ADDRESS": address, "PYTHONPATH": PATHS},
                            cwd=ROOT, stdout=subprocess.DEVNULL)


def fly(folder):
    """The record of a run."""
    control, address = controller(folder, 60, "world", "flight")
    programs = [start("world", address), start("flight", address)]
    try:
        assert control.wait(60) == 0
        assert [p.wait(20) for p in programs] == [0, 0]
    finally:
        for program in (control, *programs):
            program.kill()
            program.wait()
    return folder / "exchange.mcap"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("flown"))


def test_the_same_run_gives_the_same_bytes(flown, tmp_path):
    assert fly(tmp_path).read_bytes() == flown.read_bytes()


def test_the_record_holds_what_passes_between_nodes_and_how_they_step(flown):
    exchange = Exchange(flown)
    assert (exchange.simulation, exchange.seed, exchange.end) == ("nadir_spin", 7, 60 * 10**9)
    assert (exchange.known, exchange.limited) == (exchange.end, "")
    assert exchange.written_by("flight") == ["/flight/motor/command"]
    assert set(exchange.written_by("world")) == {"/world/nav/attitude", "/world/nav/orbit", "/world/wheels/speeds"}
    assert exchange.nodes["flight"].rates == [(500_000_000, 0)]
    assert exchange.nodes["world"].reads == {"/flight/motor/command": "next_instant"}
    assert exchange.archive.topics["/flight/motor/command"].count == 121
    assert exchange.archive["motor.command.u"].shape == (121, 8)  # as any run's archive is read


@pytest.mark.parametrize("node", ["world", "flight"])
def test_a_node_alone_does_what_it_did(flown, tmp_path, node):
    again = replay(Exchange(flown), node, [*NODE, node], out=tmp_path / "again.mcap")
    assert (again.outcome, again.differences) == ("", [])
    assert again.messages == sum(Exchange(flown).archive.topics[t].count for t in again.topics) > 100


def test_what_a_node_does_otherwise_is_named(flown, tmp_path, capsys):
    out = tmp_path / "again.mcap"
    assert main(["replay", str(flown), "flight", "--out", str(out), "--", sys.executable, "-c", CHANGED]) == 1
    printed = capsys.readouterr().out
    assert "differs  t = 0 s  flight.motor.command.u[0]:" in printed and "N m" in printed
    assert out.is_file()


def test_part_of_a_run_can_be_replayed(flown, tmp_path, capsys):
    assert main(["replay", str(flown), "flight", "--out", str(tmp_path / "a.mcap"), "--until", "10", "--",
                 *NODE, "flight"]) == 0
    assert "the same 1 topic, 21 messages, until 10 s" in capsys.readouterr().out


def test_of_a_run_that_ended_early_what_is_known_is_replayed(tmp_path):
    control, address = controller(tmp_path, 36000, "world", "flight")
    programs = [start("world", address), start("flight", address, [*NODE, "--delay", "0.001"])]
    try:
        record = tmp_path / "exchange.mcap.part"
        while not record.exists() or record.stat().st_size < 1_500_000:
            assert control.poll() is None
        programs[1].kill()
        assert control.wait(30) == 1
    finally:
        for program in (control, *programs):
            program.kill()
            program.wait()
    exchange = Exchange(tmp_path / "exchange.mcap")
    assert 0 < exchange.known < exchange.end and "the run ended early: flight" in exchange.limited
    again = replay(exchange, "flight", [*NODE, "flight"], out=tmp_path / "again.mcap")
    assert (again.outcome, again.differences) == ("", [])
    assert again.until == exchange.known and again.messages > 50


def test_a_program_that_fails_ends_the_replay(flown, tmp_path):
    again = replay(Exchange(flown), "flight", [sys.executable, "-c", "import sys; sys.exit(3)"],
                   out=tmp_path / "again.mcap")
    assert "ended with exit code 3" in again.outcome


@pytest.mark.long("flies and replays twice")
def test_the_record_of_an_earlier_replay_is_not_taken_for_this_ones(flown, tmp_path, capsys):
    (tmp_path / "again.mcap").write_bytes(flown.read_bytes())
    assert main(["replay", str(flown), "flight", "--out", str(tmp_path / "again.mcap"), "--until", "2s", "--",
                 sys.executable, "-c", "import sys; sys.exit(3)"]) == 1
    assert "record" not in capsys.readouterr().out.partition("\n")[2]
    assert not (tmp_path / "again.mcap").exists()


def test_what_cannot_be_replayed_is_refused(flown, tmp_path, capsys):
    again = ["--out", str(tmp_path / "again.mcap")]
    assert main(["replay", str(flown), "thermal", *again]) == 2
    assert "no node thermal took part; there are world, flight" in capsys.readouterr().err
    assert main(["replay", str(flown), "flight", "--out", str(flown)]) == 2
    assert "would overwrite the record" in capsys.readouterr().err
    assert main(["replay", str(flown), "flight", *again, "--until", "-1"]) == 2
    assert main(["replay", str(flown), "flight", *again, "--", str(tmp_path / "nothing")]) == 2
    assert "cannot start" in capsys.readouterr().err
    assert main(["list", "--", "anything"]) == 2
    other = tmp_path / "other.mcap"
    other.write_bytes(b"nothing")
    with pytest.raises(ArchiveError, match="not an MCAP file"):
        Exchange(other)
    assert not (tmp_path / "again.mcap").exists()

# SPDX-License-Identifier: Apache-2.0
"""A target in a co-simulation of several programs, one of which commands it and reads its telemetry while it flies."""
import struct
import sys

import pytest

from fledge import cli
from fledge.activity import happenings
from fledge.archive import Archive
from fledge.export.run_test import FLIGHT, WORLD
from fledge.targets import TARGETS

SIMULATION = """
simulation = "link"
until = 80
pace = 20
join = 300
exchange = true
watch = ["/flight/telemetry"]

[[node]]
mission = "./plays"
process = "world"
free = true

[[node]]
mission = "./plays"
process = "flight"
free = true
target = "{target}"

[[asynchronous]]
name = "ground"
command = ["{python}", "ground.py"]
writes = ["/flight/commands"]
"""

GROUND = '''
import fledge
from fledge_node import Observer

packets = fledge.load("./plays").flight.commands.packets
sent = [packets.mode("rest"), packets.noop(), b"\\x18\\x80nonsense"]
with Observer() as observer:
    observer.subscribe("/flight/telemetry")
    observer.next(10)                                   # flight is there
    whole = b"".join(sent)
    observer.write("/flight/commands", {"n": len(whole), "bytes": whole})
    got = b""
    for message in observer:
        got += bytes(message["bytes"][:message["n"]])
        if got.count(b"\\x08\\x81") == 5:
            break
print(got.hex())
'''


@pytest.fixture()
def place(tmp_path, monkeypatch):
    (tmp_path / "plays").mkdir()
    (tmp_path / "plays/flight.py").write_text(FLIGHT)
    (tmp_path / "plays/world.py").write_text(WORLD)
    (tmp_path / "ground.py").write_text(GROUND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("target", ["linux", "cfs", "leon3", "leon3-rtems", "micropython"])
def test_a_program_commands_a_target_while_it_flies(target, place, capfd):
    if TARGETS[target].missing():
        pytest.skip(f"{target} is not installed")
    (place / "link.toml").write_text(SIMULATION.format(target=target, python=sys.executable))
    assert cli.main(["up", "link.toml"]) == 0, capfd.readouterr()
    log = (place / "runs/link/log/ground.log").read_text()
    packets = list(split(bytes.fromhex(log.split()[-1])))
    reports = [struct.unpack_from(">HH" if target.startswith("leon3") else "<HH", packet, 28) for packet in packets
               if packet[:2] == b"\x08\x81"]
    assert reports == [(0, 0), (0, 0), (0, 1), (1, 0), (1, 0)]  # executed, reason: the third has a wrong length
    record = Archive(place / f"runs/link/flight/{target}.mcap")
    said = [(one.kind, one.name.partition(",")[0], one.text) for one in happenings(record) if one.kind != "event"]
    assert ("mode", "rest", "") in said and [one for one in said if one[0] == "command"] == [
        ("command", "mode", "accepted"), ("command", "noop", "accepted"),
        ("command", "function 101", "refused at its arrival: length"),
        ("command", "mode", "executed"), ("command", "noop", "executed")]
    assert cli.main(["replay", "runs/link", "flight", "--", *fly(target, place)]) == 0, capfd.readouterr()


def split(packets):
    """The packets that follow one another, by their lengths."""
    while packets:
        n = int.from_bytes(packets[4:6], "big") + 7
        yield packets[:n]
        packets = packets[n:]


def fly(target, place):
    return [sys.executable, "-P", "-m", "fledge.cli", "fly", "./plays", "--free", "--on", f"flight={target}", "--join",
            "--out", str(place / "again")]


@pytest.mark.parametrize("line, says", [
    ('target = "vax"', "there is no `vax`"),
    ('target = "linus"', "did you mean `linux`?"),
    ('board = ["board.toml"]', "`board` is of a `target`"),
    ('target = "linux"\nboard = ["no.toml"]', "there is no "),
])
def test_what_cannot_fly_is_refused_before_anything_starts(line, says, place, capsys):
    text = SIMULATION.format(target="linux", python=sys.executable).replace('target = "linux"', line)
    (place / "link.toml").write_text(text)
    assert cli.main(["up", "link.toml", "--check"]) == 2
    assert says in capsys.readouterr().err


def test_the_world_flies_on_no_target(place, capsys):
    text = SIMULATION.format(target="linux", python=sys.executable).replace(
        'process = "world"', 'process = "world"\ntarget = "linux"')
    (place / "link.toml").write_text(text)
    assert cli.main(["up", "link.toml", "--check"]) == 2
    assert "a target flies a flight process; world is none" in capsys.readouterr().err

# SPDX-License-Identifier: Apache-2.0
"""A target in a co-simulation of several programs, one of which commands it and reads its telemetry while it flies."""
import re
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress

import pytest
import yaml

from fledge import cli, ground
from fledge.archive import Archive
from fledge.cosim.up.testing import set_pace, steered
from fledge.errors import Failure, SetupError
from fledge.export.run_test import FLIGHT, WORLD
from fledge.export.xtce_test import Reader
from fledge.ground.scripts.links import NoAnswer, split
from fledge.records.activity import happenings
from fledge.targets import TARGETS
from tests.circles import long_after
from tests.needs import needs, skip_unless_on
from tests.waiting import PATIENCE, wait_for

NODES = """
[[node]]
mission = "./plays"
process = "world"
free = true

[[node]]
mission = "./plays"
process = "flight"
free = true
target = "{target}"
"""
SIMULATION = """
simulation = "link"
until = 80
pace = 1
join = 300
exchange = true
watch = ["/flight/telemetry"]
""" + NODES + """
[[asynchronous]]
name = "ground"
command = ["{python}", "ground.py"]
writes = ["/flight/commands"]
steers = true
"""

GROUND = '''
import time

import fledge
from fledge.cosim.steering import Steering
from fledge_node import Observer

packets = fledge.load("./plays").flight.commands.packets
sent = [packets.mode("rest"), packets.noop(), b"\\x18\\x80nonsense"]
with Observer() as observer:
    observer.subscribe("/flight/telemetry")
    observer.next()                                     # flight is there
    whole = b"".join(sent)
    observer.write("/flight/commands", {"n": len(whole), "bytes": whole})
    got = b""
    for message in observer:
        got += bytes(message["bytes"][:message["n"]])
        if got.count(b"\\x08\\x81") == 5:
            break
print(got.hex(), flush=True)
hand = Steering.of_run()
hand.pace(0)                                            # the run's end does not come before
time.sleep(1e6)
'''


@pytest.fixture()
def place(tmp_path, monkeypatch):
    (tmp_path / "plays").mkdir()
    (tmp_path / "plays/flight.py").write_text(FLIGHT)
    (tmp_path / "plays/world.py").write_text(WORLD)
    (tmp_path / "ground.py").write_text(GROUND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("target", long_after(
    1, ["linux", "cfs", "leon3", "leon3-rtems", "micropython"], "builds and flies on another target"))
def test_a_program_commands_a_target_while_it_flies(target, place, capfd):
    skip_unless_on(target)
    (place / "link.toml").write_text(SIMULATION.format(target=target, python=sys.executable))
    assert cli.main(["up", "link.toml"]) == 0, capfd.readouterr()
    log = (place / "runs/link/log/ground.log").read_text()
    packets, rest = split(bytes.fromhex(log.split()[-1]))
    assert rest == b""
    reports = [struct.unpack_from(">HH", packet, 28) for packet in packets
               if packet[:2] == b"\x08\x81"]
    assert reports == [(0, 0), (0, 0), (0, 1), (1, 0), (1, 0)]  # executed, reason: the third has a wrong length
    record = Archive(place / f"runs/link/flight/{target}.mcap")
    events = [(happening.kind, happening.name.partition(",")[0], happening.text)
              for happening in happenings(record) if happening.kind != "event"]
    assert ("mode", "rest", "") in events and [event for event in events if event[0] == "command"] == [
        ("command", "mode", "accepted"), ("command", "noop", "accepted"),
        ("command", "function 101", "refused at its arrival: length"),
        ("command", "mode", "executed"), ("command", "noop", "executed")]
    assert cli.main(["replay", "runs/link", "flight", "--", *fly(target, place)]) == 0, capfd.readouterr()


SCRIPT = '''
import sys

import fledge
from fledge import ground
from fledge.errors import Failure
from fledge.units import s

with ground.connect(sys.argv[1] if len(sys.argv) > 1 else fledge.load("./plays"), "./plays") as craft:
    def say(*what):
        print(*what, craft.link.t / 1e9)

    craft.listen(1 * s)
    craft.command("telemetry").completed(within=5 * s)
    say(craft.command("mode", "point").completed(within=5 * s))
    say(craft.wait(lambda t: t.mode == "point", within=5 * s).flight.tracking.error.sigma_BR)
    say(craft.command("write", "flight.control", K=3.0, u_I_max=0.2).accepted().completed().reports)
    say(craft.command("read", "flight.control").completed().data.hex())
    for wrong in ("write", {"K": -1.0}), ("write", {"u_I_max": -1.0}):
        try:
            craft.command(wrong[0], "flight.control", **wrong[1]).completed()
        except Failure as error:
            say(error)
    say(craft.wait(lambda t: t.flight.control.torque.head.t > 20e9, within=20 * s)["flight.control.torque"])
    say(craft.telemetry.housekeeping, craft.missed, craft.refused)
'''
NODE = """
simulation = "link"
until = 40
join = 300
exchange = true

""" + NODES + """
[[node]]
name = "script"
command = ["{python}", "script.py", "cosim:flight?every=0.1"]
"""


@pytest.mark.parametrize("target", long_after(
    1, ["linux", "cfs", "leon3", "micropython"], "builds and flies on another target"))
def test_a_script_of_the_ground_says_the_same_on_the_desktop_and_on_a_target(target, place, capfd):
    """As a node, for which the run waits: the same answers, telemetry and times."""
    skip_unless_on(target)
    (place / "script.py").write_text(SCRIPT)
    (place / "node.toml").write_text(NODE.format(target=target, python=sys.executable))
    assert cli.main(["up", "node.toml"]) == 0, capfd.readouterr()
    log = (place / "runs/link/log/script.log").read_text().splitlines()
    desktop = subprocess.run([sys.executable, "script.py"], text=True, capture_output=True, check=True).stdout
    assert len(log) == 8 and log == desktop.splitlines()


CARRYING = FLIGHT + """
    f.files = fsw.Files(entity=2, ground=1, rate=8000 / s, ack_timer=2 * s, nak_timer=2 * s, allowed=15)
    f.task("files", every=100 * ms, run=[f.files])
"""
CARRIES = '''
import sys
from pathlib import Path
from random import Random

import fledge
from fledge import ground
from fledge.errors import Failure
from fledge.ground.scripts.files import Files
from fledge.units import minute, s

with ground.connect(sys.argv[1] if len(sys.argv) > 1 else fledge.load("./plays"), "./plays") as craft:
    dice, send, receive = Random(1), craft.link.send, craft.link.receive
    first = craft.dictionary.texts + 1                  # of the streams of services

    def lossy(packet):
        if packet[6] != 19 or dice.random() > 0.1:
            send(packet)

    def say(*what):
        print(*what, craft.link.t / 1e9)

    craft.link.send = lossy
    craft.link.receive = lambda until: [one for one in receive(until) if int.from_bytes(one.packet[:2], "big") < first
                                        or dice.random() > 0.1]
    craft.files = Files(craft, rate=8000, timeout=2 * s)
    plan = Random(2).randbytes(9000)
    Path("plan").write_bytes(plan)
    craft.listen(1 * s)
    craft.command("telemetry", "flight.files.state").completed()
    sent = craft.put("plan")
    craft.listen(0.4 * s)
    craft.command("reset").completed()                  # flight begins anew, and the file goes on
    say(sent.completed(within=1 * minute))
    got = craft.fetch("plan", to="got")
    craft.wait(lambda _: got.done > 2000, within=20 * s)
    got.suspend()
    craft.listen(1 * s)
    done = got.done
    craft.listen(3 * s)
    say("paused" if done == got.done < got.size else got)
    got.resume()
    say(got.completed(within=1 * minute), Path("got").read_bytes() == plan)
    down = craft.command("send_file", "plan").started()
    down.completed(within=1 * minute)
    craft.wait(lambda _: craft.files.received, within=20 * s)       # when the end of the end has come, too
    say(down.progress, craft.files.received[-1].read_bytes() == plan)
    say(craft.directory())
    try:
        craft.fetch("none", to="none", within=20 * s)
    except Failure as error:
        say(error)
    craft.listen(1 * s)
    say(craft.telemetry.flight.files.state)
'''


@pytest.mark.long("files over a link with losses")
def test_files_go_to_targets_over_a_link_with_losses_as_to_the_desktop(place, capfd):
    """Each way, over a reset of flight and a pause. Targets say the same at the same times; on the desktop, where the
    script looks more often than a node, losses meet other packets."""
    on = [name for name in ("linux", "leon3") if not TARGETS[name].missing()]
    (place / "plays/flight.py").write_text(CARRYING)
    (place / "script.py").write_text(CARRIES)
    log = []
    for target in on:
        (place / "node.toml").write_text(NODE.format(target=target, python=sys.executable))
        assert cli.main(["up", "node.toml"]) == 0, capfd.readouterr()
        log.append((place / "runs/link/log/script.log").read_text().splitlines())
    assert log == log[:1] * len(on)
    desktop = subprocess.run([sys.executable, "script.py"], text=True, capture_output=True, check=True).stdout
    for lines in (log[0], desktop.splitlines()):
        assert [line.rpartition(" ")[0] for line in lines[:-1]] == [
            "<send plan as plan: complete>", "paused", "<fetch plan: complete> True", "100 True", "['plan']",
            "fetch none: the file store refused it on board"]
        assert "'delivered': 3, 'failed': 0" in lines[-1]


FRAMES = '''
    f.link = fsw.SpaceLink(spacecraft=42, command_channel=3, telemetry_channel=2, frame_size=512, cop1=1, window=20,
                           cltu=1, segments=1, map=5, tc_random=1, tm_random=1, marker=1, idle=1 * s{secured})
    f.task("link", every=500 * ms, run=[f.link])
'''
LOSSY = '''
import random
import sys

import fledge
from fledge import ground
from fledge.ground.scripts.links import Link
from fledge.units import s


class Lossy(Link):
    """Loses 20 % of the units both ways, and sends old ones again."""

    def __init__(self, link):
        self.link, self.random, self.old = link, random.Random(4), []

    @property
    def t(self):
        return self.link.t

    def send(self, unit):
        self.old.append(unit)
        for one in (unit, self.random.choice(self.old[-9:])):
            if self.random.random() > 0.2:
                self.link.send(one)

    def receive(self, until):
        return [one for one in self.link.receive(until) if self.random.random() > 0.2]

    def close(self):
        self.link.close()


with ground.connect(sys.argv[1] if len(sys.argv) > 1 else fledge.load("./plays"), "./plays",
                    keys="plays/link.keys") as craft:
    craft.link.link = Lossy(craft.link.link)
    sent = [craft.command("telemetry"), *(craft.command("write", "flight.control", K=1.0 + i) for i in range(30)),
            craft.command("mode", "rest")]
    for one in sent:
        one.delivered(within=60 * s)
    counted = craft.wait(lambda t: t.flight.link.state.head.t > 30e9, within=60 * s).housekeeping
    print(counted["executed"], counted["refused"], counted["last"], craft.link.counts["missing"] > 20)
'''


SECURED = ', secured=2, telemetry_key=1, roles=[{"key": 1}, {}, {}, {}]'


@pytest.mark.long("flies on targets by the wall clock")
@pytest.mark.parametrize("target, secured", [("linux", SECURED), ("leon3", "")])
def test_over_frames_a_script_says_the_same_on_the_desktop_and_on_a_target(target, secured, place, capfd):
    """Also over a link that loses and repeats: each command is executed once and in order."""
    skip_unless_on(target)
    (place / "plays/flight.py").write_text(FLIGHT + FRAMES.format(secured=secured))
    assert cli.main(["keys", "link", "plays/link.keys"]) == 0
    (place / "script.py").write_text(SCRIPT.replace('"./plays") as', '"./plays", keys="plays/link.keys") as'))
    (place / "lossy.py").write_text(LOSSY)
    (place / "node.toml").write_text(NODE.format(target=target, python=sys.executable))
    lossy = NODE.format(target=target, python=sys.executable).replace("script", "lossy").replace("= 40", "= 50")
    (place / "lossy.toml").write_text(lossy.replace('simulation = "link"', 'simulation = "lossy"'))
    for name in ("node", "lossy"):
        assert cli.main(["up", f"{name}.toml"]) == 0, capfd.readouterr()
    log = (place / "runs/link/log/script.log").read_text().splitlines()
    desktop = subprocess.run([sys.executable, "script.py"], text=True, capture_output=True, check=True).stdout
    assert len(log) == 8 and log == desktop.splitlines()
    log = (place / "runs/lossy/log/lossy.log").read_text()
    desktop = subprocess.run([sys.executable, "lossy.py"], text=True, capture_output=True, check=True).stdout
    assert log == desktop == "32 0 31 True\n"


BRIDGE = """
simulation = "link"
until = 240
pace = 4
join = 300
exchange = true

""" + NODES.replace("{target}", "linux") + """
[[asynchronous]]
name = "tool"
process = "flight"
link = "udp://127.0.0.1:{back}?listen={port}"

[[asynchronous]]
name = "spectator"
process = "flight"
link = "listen://{second}"
writes = []
"""


@pytest.mark.long("flies on targets by the wall clock")
def test_foreign_tools_command_a_target_by_links(place, capfd):
    """What they send is in the record of the exchange, from which flight flies again to the same bits. The run does
    not wait for them."""
    port, back, second = (free_port() for _ in range(3))
    (place / "bridge.toml").write_text(BRIDGE.format(port=port, back=back, second=second) + steered(place))
    run = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", "bridge.toml"], stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, text=True)
    try:
        spectator = connected(run, f"tcp://127.0.0.1:{second}")
        with spectator, ground.connect(f"udp://127.0.0.1:{port}?listen={back}", "./plays") as craft:
            executed = None
            while not executed:         # a datagram is lost if the tool's link is not open yet
                assert run.poll() is None
                with suppress(NoAnswer):
                    executed = craft.command("noop").completed(within=1)
            craft.command("telemetry", "housekeeping").completed(within=PATIENCE)
            craft.command("mode", "rest").completed(within=PATIENCE)
            assert craft.wait(lambda t: t.mode == "rest", within=PATIENCE)
            assert spectator.wait(lambda t: t.mode == "rest", within=PATIENCE)
            with pytest.raises(Failure, match="was not reported"):
                spectator.command("mode", "point").accepted(within=0.5)
            craft.link.send(b"\x18\x80no command at all")
            assert craft.command("noop").completed(within=PATIENCE)
        set_pace(place, 0)
        text = run.communicate()[0]
    finally:
        run.kill()
    assert run.returncode == 0, text
    log = (place / "runs/link/log/tool.log").read_text()
    carried = re.search(r"carried  (\d+) commands, \d+ packets of telemetry;(?: \d+ messages were missed;)? "
                        "19 bytes were no packet\n", log)
    assert carried and int(carried[1]) >= 4, log
    record = Archive(place / "runs/link/flight/linux.mcap")
    events = [(happening.name.partition(",")[0], happening.text)
              for happening in happenings(record) if happening.kind == "command"]
    assert ("mode", "executed") in events and ("noop", "executed") == events[-1]
    assert cli.main(["replay", "runs/link", "flight", "--", *fly("linux", place)]) == 0, capfd.readouterr()


STATION = """
simulation = "link"
until = 240
pace = 4
join = 300

""" + NODES.replace("{target}", "linux") + """
[[asynchronous]]
name = "station"
process = "flight"
link = "udp://127.0.0.1:{telemetry}?listen={commands}"
"""


class Station:
    """A ground station that knows the folder of `--yamcs` and nothing else: the ports of its file, the packets and
    verifiers of its XTCE; it gives commands their sequence, length and checksum as CfsCommandPostprocessor does."""

    def __init__(self, folder, name):
        links = {dataLink["class"].rpartition(".")[2]: dataLink for dataLink in yaml.safe_load(
            (folder / f"etc/yamcs.{name}.yaml").read_text(encoding="utf-8"))["dataLinks"]}
        self.reader = Reader((folder / f"mdb/{name}.xml").read_text(encoding="utf-8"))
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", links["UdpTmDataLink"]["port"]))
        self.there = (links["UdpTcDataLink"]["host"], links["UdpTcDataLink"]["port"])
        self.sequence, self.seen = 0, []        # datagrams both ways, in their order

    def packet(self, seconds):
        """Raw values of the next packet by the parameters' names; None: none comes in time."""
        self.socket.settimeout(seconds)
        try:
            packet = self.socket.recv(1500)
        except TimeoutError:
            return None
        self.seen.append(packet)
        paths = self.reader.decode(packet, "flight_packet")[1]
        return {name: paths[Reader.alias(parameter)] for name, parameter in self.reader.parameters.items()
                if Reader.alias(parameter) in paths}

    def command(self, name, within=PATIENCE, **arguments):
        """Send a command; the tags of its verifiers up to one that ends it, or those that came in time [s]."""
        sequence, self.sequence = self.sequence, self.sequence + 1
        self.seen.append(self.reader.encode(name, sequence, **arguments))
        self.socket.sendto(self.seen[-1], self.there)
        sets = [meta.find("VerifierSet") for meta in self.reader.chain(name)]
        verifiers = next(verifiers for verifiers in reversed(sets) if verifiers is not None)
        end, tags = time.monotonic() + within, []
        while time.monotonic() < end and tags[-1:] not in (["CompleteVerifier"], ["FailedVerifier"]):
            if values := self.packet(1):
                tags += [verifier.tag for verifier in verifiers if self.holds(verifier, values, sequence)]
        return tags

    @staticmethod
    def holds(verifier, values, sequence):
        for condition in verifier.iter("Condition"):
            left = values.get(condition.find("ParameterInstanceRef").get("parameterRef"))
            right = [sequence for reference in condition.iterfind("ParameterInstanceRef")
                     if reference.get("parameterRef") == "/yamcs/cmdHist/ccsds-seqcount"]
            right += [int(value.text) for value in condition.iterfind("Value")]
            if left is None or (left == right[0]) != (condition.find("ComparisonOperator").text == "=="):
                return False
        return True


def shown_by_wireshark(packets, path):
    """(type, secondary header, stream, flags, sequence, length) of each, by a decoder that is not ours."""
    records = b"".join(struct.pack(">IIII", 0, 0, len(packet), len(packet)) + packet for packet in packets)
    path.write_bytes(struct.pack(">IIIIII", 0xA1B2C3D4, 0x00020004, 0, 0, 131072, 147) + records)
    fields = [word for name in ("type", "secheader", "apid", "seqflag", "seqnum", "length")
              for word in ("-e", f"ccsds.{name}")]
    text = subprocess.run(["tshark", "-n", "-r", path, "-o", 'uat:user_dlts:"User 0 (DLT=147)","ccsds","0","","0",""',
                           "-T", "fields", *fields], capture_output=True, text=True, check=True).stdout
    return [[int(word, 0) for word in line.split()] for line in text.splitlines()]


@pytest.mark.long("flies by the wall clock")
@needs("tshark")
def test_a_station_that_has_the_exported_folder_alone_commands_a_running_simulation(place, tmp_path, capfd):
    assert cli.main(["export", "xtce", "./plays", "--yamcs", "--out", "out"]) == 0, capfd.readouterr()
    ports = {10015: free_port(), 10025: free_port()}
    file = place / "out/yamcs/etc/yamcs.plays.yaml"
    file.write_text(re.sub("10015|10025", lambda match: str(ports[int(match[0])]), file.read_text()))
    station = Station(place / "out/yamcs", "plays")
    (place / "station.toml").write_text(STATION.format(telemetry=ports[10015], commands=ports[10025])
                                        + steered(place))
    run = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", "station.toml"], stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, text=True)
    try:
        while not (tags := station.command("flight_noop", within=1)):     # until flight is there
            assert run.poll() is None
        assert tags == ["AcceptedVerifier", "CompleteVerifier"]
        assert station.command("flight_telemetry", output="flight.housekeeping", every=10)[-1] == "CompleteVerifier"
        assert station.command("flight_mode", mode="rest") == ["AcceptedVerifier", "CompleteVerifier"]
        assert station.command("flight_write_control_K", K=-1.0)[-1] == "FailedVerifier"
        housekeeping = []
        while len(housekeeping) < 3:
            values = station.packet(PATIENCE)
            assert values is not None
            housekeeping += [values] if "flight_housekeeping_mode" in values else []
        set_pace(place, 0)
        text = run.communicate()[0]
    finally:
        run.kill()
        station.socket.close()
    assert run.returncode == 0, text
    shown = shown_by_wireshark(station.seen, tmp_path / "seen.pcap")
    assert len(shown) == len(station.seen) and {tuple(row[:2]) for row in shown} == {(0, 1), (1, 1)}
    assert all(flags == 3 and length + 7 == len(packet) for (_, _, _, flags, _, length), packet in zip(
        shown, station.seen))
    sent = [number for kind, _, _, _, number, _ in shown if kind == 1]
    assert sent == list(range(len(sent)))
    for stream in {apid for kind, _, apid, *_ in shown if kind == 0}:
        numbers = [number for kind, _, apid, _, number, _ in shown if (kind, apid) == (0, stream)]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), stream


BY_HAND = """
simulation = "link"
until = 240
pace = 4
join = 300
exchange = true

""" + NODES.replace("{target}", "linux") + """
[[asynchronous]]
name = "carrier"
process = "flight"
link = "listen://{port}"
"""


@pytest.mark.long("flies by the wall clock")
def test_files_go_by_hand_to_a_target_while_it_flies(place, capfd):
    """By a link that does not wait, and the record of the exchange has their PDUs."""
    port = free_port()
    (place / "plays/flight.py").write_text(CARRYING)
    (place / "hand.toml").write_text(BY_HAND.format(port=port) + steered(place))
    (place / "plan").write_bytes(bytes(range(256)) * 12)
    there = ["--to", f"tcp://127.0.0.1:{port}", "./plays"]
    run = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", "hand.toml"], stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, text=True)
    try:
        connected(run, there[1]).link.close()
        assert cli.main(["send", "plan", "--as", "next", *there]) == 0, capfd.readouterr()
        assert cli.main(["fetch", "next", *there]) == 0, capfd.readouterr()
        assert (place / "next").read_bytes() == (place / "plan").read_bytes()
        set_pace(place, 0)
        text = run.communicate()[0]
    finally:
        run.kill()
    assert run.returncode == 0, text
    assert cli.main(["replay", "runs/link", "flight", "--", *fly("linux", place)]) == 0, capfd.readouterr()


def connected(run, address):
    """A craft behind a link that a run opens when it begins."""
    def craft():
        with suppress(SetupError):
            return ground.connect(address, "./plays")

    return wait_for(craft, run)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


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

# SPDX-License-Identifier: Apache-2.0
"""The control room of a co-simulation has every packet of the run, however busy the machine; what a killed server did
not hear is noted as a gap."""
import json
import os
import random
import re
import resource
import signal
import socket
import sqlite3
import struct
import subprocess
import time
from collections import deque
from contextlib import ExitStack, suppress
from pathlib import Path
from urllib.request import Request, urlopen

import pytest

from fledge.archive import Archive
from fledge.cosim.steering import Steering
from fledge.cosim.up.processes import descendants
from fledge.ground.server.cosim_test import Flown
from fledge.ground.server.room import Room
from fledge.ground.server.run_control import Steered
from fledge.ground.server.settings import read as read_settings
from fledge.ground.scripts import member
from fledge.ground.captures import read
from fledge.ground.database import Database
from fledge.ground.scripts.links import split
from tests.waiting import wait_for

OUTPUTS = ["flight.guidance.reference", "flight.tracking.error", "flight.control.torque", "flight.motor.command"]
RUNS = int(os.environ.get("FLEDGE_HEARD_RUNS", "1"))


class Busy(Flown):
    """A run with a server, and two compilers beside it."""

    def __init__(self, folder, until, pace, compilers=2, settings="exchange = true"):
        super().__init__(folder, "linux", 0, until, 1, settings, 'on_loss = "restart"\n')
        self.pace = pace
        (folder / "busy.cpp").write_text('#include <regex>\nbool is(std::string s) { return std::regex_match(s, '
                                         'std::regex("a*b")); }\n')
        self.compilers = [["sh", "-c", "while :; do g++ -O2 -c busy.cpp -o /dev/null; done"]] * compilers
        self.stack = ExitStack()
        self.headers = {}
        self.log = folder / "runs/room/log/ground.log"

    def __enter__(self):
        for command in self.compilers:
            process = subprocess.Popen(command, cwd=self.folder, start_new_session=True)
            self.stack.callback(os.killpg, process.pid, signal.SIGKILL)
        return super().__enter__()

    def __exit__(self, *_):
        self.stack.close()
        super().__exit__()

    def ask(self, path, content=None):
        self.address()
        address = re.findall(r"http://\S+/", self.log.read_text())[-1]     # of the server that was started last
        if content is not None and not self.headers:
            self.headers["X-Fledge-CSRF"] = self.ask("session")["csrf"]
        body = None if content is None else json.dumps(content).encode()
        return json.loads(urlopen(Request(f"{address}api/{path}", body, self.headers)).read())

    def begin(self):
        """Ask for telemetry, and then let the run go on at its pace, so that it has not ended before."""
        self.until(lambda: self.ask("crafts")[0]["link"]["up"])
        for output in OUTPUTS:
            self.ask("crafts/nadir_spin/send", {"name": "flight.telemetry", "arguments": {
                "output": output, "every": 1}})
        self.ask("crafts/nadir_spin/run", {"action": "go", "speed": self.pace})

    def sent(self):
        """(time, packet) of each in the record of the exchange."""
        path = self.folder / "runs/room/exchange.mcap"
        record = Archive(path if path.exists() else f"{path}.part")
        times = record.time_ns("/flight/telemetry").tolist()
        return [(t, packet) for t, message in zip(times, record["/flight/telemetry"])
                for packet in split(message["bytes"].tobytes()[:int(message["n"])])[0]]

    def archived(self):
        def order(path):
            return [int(word) for word in path.name.split(".")[0].split("-")]

        return [(piece.time, piece.packet) for path in sorted((self.folder / "room/archive/nadir_spin").glob("*.mcap*"),
                                                              key=order) for piece in read(path)]


@pytest.mark.long("co-simulations with a server, beside compilers")
@pytest.mark.parametrize("pace", [50, 0])
@pytest.mark.parametrize("run", range(RUNS))
def test_the_archive_has_every_packet_of_the_record_and_their_values(run, pace, tmp_path):
    with Busy(tmp_path, 6000 if pace == 0 else 1000, pace) as flown:
        flown.begin()
        flown.run.wait()
    sent, archived = flown.sent(), flown.archived()
    assert len(sent) > 1000 and archived == sent
    history = Database.load(tmp_path / "room/databases/nadir_spin.xml").history(tmp_path / "room/archive",
                                                                                "nadir_spin")
    assert [session["gaps"] for session in history.sessions()] == [[]]
    record = Archive(tmp_path / "runs/room/exchange.mcap")
    names = [f"flight.motor.command.{part}" for part in ("head.t", "u[0]", "u[1]", "u[2]")]
    rows = list(zip(*(history.series([name], exact=True)[name][6][1] for name in names)))
    flown_values = dict(zip(record["motor.command.head.t"].tolist(), record["motor.command.u"][:, :3].tolist()))
    assert len(rows) > 100 and all(flown_values[t] == values for t, *values in rows)


@pytest.mark.long("a co-simulation with a server, which is killed")
def test_what_a_killed_server_did_not_hear_is_a_gap_and_an_event_and_its_commands_are_unknown(tmp_path):
    with Busy(tmp_path, 36_000, 20, compilers=0) as flown:
        flown.begin()
        flown.until(lambda: flown.ask("crafts")[0]["packets"] > 100)
        before = flown.ask("crafts/nadir_spin/run")
        server = next(int(path.parent.name) for path in Path("/proc").glob("[0-9]*/cmdline")
                      if b"serve\0" in (text := path.read_bytes()) and str(tmp_path).encode() in text
                      and b"guard" not in text)
        os.kill(server, signal.SIGKILL)
        flown.until(lambda: flown.log.read_text().count(" is at http") == 2)
        flown.until(lambda: (crafts := flown.ask("crafts")) and crafts[0]["packets"] > 100)
        first, second = flown.ask("crafts/nadir_spin/sessions")
        events = [row["text"] for row in flown.ask("crafts/nadir_spin/events")]
    begin, end = int(first["last_ns"]), int(second["first_ns"])
    assert int(before["t_ns"]) <= begin < end
    assert second["gaps"] == [[str(begin), str(end), "restart; the session before: killed"]]
    assert f"telemetry is missing from {begin / 1e9:g} s to {end / 1e9:g} s: /flight/telemetry was not heard here" in \
        events
    assert flown.archived() == [row for row in flown.sent() if not begin < row[0] < end][:len(flown.archived())]


def programs(flown, word):
    """The processes of a run whose command has the word, guards apart."""
    found = []
    for pid in descendants(flown.run.pid):
        with suppress(OSError):
            command = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
            if not command[0].endswith(b"guard") and any(part.endswith(word) for part in command):
                found.append(pid)
    return found


@pytest.mark.long("co-simulations with a server, in which a program is killed")
@pytest.mark.parametrize("seed", range(int(os.environ.get("FLEDGE_KILL_CYCLES", "1"))))
@pytest.mark.parametrize("victim, settings", [
    ("controller", "exchange = true"), ("controller", "keep_every = 30"), ("controller", ""), ("up", "exchange = true"),
    ("flight", "exchange = true"), ("disk", "exchange = true")])
@pytest.mark.parametrize("pace", [50, 0])
def test_whichever_program_is_killed_the_archive_has_what_the_record_has_or_names_a_gap(pace, victim, settings, seed,
                                                                                        tmp_path):
    rng = random.Random(f"{pace} {victim} {settings} {seed}")
    with Busy(tmp_path, 360_000, pace, compilers=0, settings=settings) as flown:
        flown.begin()
        flown.until(lambda: flown.ask("crafts")[0]["packets"] > 100)
        controller, = programs(flown, b"fledge_controller")
        server, = programs(flown, b"serve")
        time.sleep(rng.uniform(0, 0.5))
        os.kill(server, signal.SIGSTOP)         # so that it is behind
        time.sleep(rng.uniform(0.2, 1.2))
        if victim == "disk":
            size = (tmp_path / "runs/room/exchange.mcap.part").stat().st_size
            resource.prlimit(controller, resource.RLIMIT_FSIZE, (size, size))
        else:
            os.kill({"up": flown.run.pid, "controller": controller}.get(victim) or programs(flown, b"fly")[0],
                    signal.SIGKILL)
        os.kill(server, signal.SIGCONT)
        flown.run.wait()
        wait_for(lambda: not Path(f"/proc/{server}").exists())
    archived = flown.archived()
    assert len(archived) > 100 and len(set(archived)) == len(archived)
    if settings:
        sent = flown.sent()
        assert archived[:len(sent)] == sent
    session, = Database.load(tmp_path / "room/databases/nadir_spin.xml").history(
        tmp_path / "room/archive", "nadir_spin").sessions()
    assert session["ended"] == "closed" and session["packets"] == len(archived)
    events = [json.loads(text)["text"] for text, in sqlite3.connect(tmp_path / "room/journal.sqlite").execute(
        "select content from events")]
    assert any("the link is down: " in text for text in events)
    if victim == "controller":
        (begin, end, why), = session["gaps"]
        assert begin == archived[-1][0] <= end and why.startswith("the controller is gone")
        assert f"telemetry is missing from {begin / 1e9:g} s to {end / 1e9:g} s: {why}" in events
    else:
        assert session["gaps"] == [] and (victim == "disk" or archived == sent)


class Run:
    """In place of the run's broker: messages of telemetry as a test puts them, with their counts."""

    NodeError = RuntimeError
    topics: dict = {}
    reason = None
    lost = gone = False
    t = 0

    def __init__(self):
        self.waiting, self.counts = deque(), 0

    def Observer(self):
        return self

    def subscribe(self, *topics):
        pass

    write = close = subscribe

    def put(self, t, packet, lost=0):
        self.counts += 1 + lost
        self.waiting.append((int(t * 1e9), packet, self.counts))

    def next(self, timeout):
        if not self.waiting and self.gone:
            raise self.NodeError("the controller is gone")
        if not self.waiting:
            time.sleep(min(timeout, 0.01))
            return None
        self.t, packet, count = self.waiting.popleft()
        missed, self.last = count - getattr(self, "last", count - 1) - 1, count
        return Message({"n": len(packet), "bytes": packet}, "/flight/telemetry", self.t, count, missed)


class Message(dict):
    def __init__(self, values, topic, t, count, missed):
        super().__init__(values)
        self.topic, self.t, self.count, self.missed = topic, t, count, missed


def packet(k):
    return struct.pack(">HHH2x", 0x0801, 0xC000 | k, 1)


def record(times, ended=False):
    """A record of the exchange as MCAP's specification has it, without chunks and summary, which are optional; and
    where its messages begin."""
    def text(words):
        return struct.pack("<I", len(words)) + words.encode()

    def pairs(values):
        whole = b"".join(text(key) + text(value) for key, value in values.items())
        return struct.pack("<I", len(whole)) + whole

    def op(code, content):
        return struct.pack("<BQ", code, len(content)) + content

    schema = text("uint32 n  # n [byte] of the packets\nuint8[12] bytes  # bytes [-] packets\n")
    whole = b"\x89MCAP0\r\n" + op(1, text("") + text("test"))
    whole += op(3, struct.pack("<H", 1) + text("fledge/msg/Packets12") + text("ros2msg") + schema)
    whole += op(4, struct.pack("<HH", 1, 1) + text("/flight/telemetry") + text("cdr") + pairs({"writer": "flight"}))
    begins = []
    for k, t in enumerate(times):
        begins.append(len(whole))
        whole += op(5, struct.pack("<HIQQ", 1, k + 1, t * 10**9, t * 10**9) + b"\0\1\0\0"
                    + struct.pack("<I12s", 8, packet(t)))
    if ended:
        whole += op(12, text("end") + pairs({"reason": ""})) + op(15, bytes(4)) + op(2, bytes(20)) + whole[:8]
    return whole, begins


def heard(run, monkeypatch, path):
    """All that a link has until the controller is gone, why it ended, and its gaps."""
    monkeypatch.setattr(member, "_bindings", lambda: run)
    monkeypatch.setenv("FLEDGE_EXCHANGE", str(path or ""))
    for t in (1, 2, 3):
        run.put(t, packet(t))
    run.gone = True
    link, came = member.Onlooker("flight"), []
    link.wait = 0.02
    with pytest.raises(ConnectionError) as ended:
        while True:
            came += link.receive(link.t + 10**9)
    with pytest.raises(ConnectionError):
        link.receive(link.t + 10**9)
    assert [unit.packet for unit in came] == [packet(unit.t // 10**9) for unit in came]
    return [unit.t // 10**9 for unit in came], str(ended.value), link.gaps()


def test_a_link_has_the_rest_from_the_record_of_a_lost_controller_wherever_that_is_cut(tmp_path, monkeypatch):
    path = tmp_path / "exchange.mcap"
    part, (whole, begins) = Path(f"{path}.part"), record([1, 2, 3, 4, 5, 6])
    for size in [*range(begins[4], len(whole) + 1), begins[1] + 5]:
        part.write_bytes(whole[:size])
        last = max(sum(begin <= size for begin in [*begins[1:], len(whole)]), 3)
        times, why, gaps = heard(Run(), monkeypatch, path)
        assert times == [*range(1, last + 1)]
        assert why == (f"the controller is gone; {last - 3} messages of /flight/telemetry are from {part}; "
                       "what was sent later is lost")
        assert gaps == [(last * 10**9, -1, why)]
    path.write_bytes(record([1, 2, 3, 4], ended=True)[0])
    assert heard(Run(), monkeypatch, path) == (
        [1, 2, 3, 4], f"the controller is gone; 1 messages of /flight/telemetry are from {path}", [])


def test_a_link_without_a_record_of_a_lost_controller_has_a_gap(tmp_path, monkeypatch):
    none = tmp_path / "none.mcap"
    for path, why in ((None, "there is no record of its messages here"),
                      (none, f"its record cannot be read: {none}.part: cannot be opened")):
        times, ended, gaps = heard(Run(), monkeypatch, path)
        assert times == [1, 2, 3] and f"the controller is gone, and {why}" in ended
        assert gaps == [(3 * 10**9, -1, ended)]


def test_a_gap_has_its_times_an_event_and_unknown_commands_and_the_last_message_comes_once(tmp_path, monkeypatch):
    run = Run()
    monkeypatch.setattr(member, "_bindings", lambda: run)
    (tmp_path / "room.toml").write_text('folder = "room"\n[[craft]]\nname = "craft"\nmission = "nadir_spin"\n'
                                        'link = "cosim:flight"\n')

    def served(until, do):
        room = Room(read_settings(tmp_path / "room.toml"))
        try:
            craft = room.crafts["craft"]
            craft.start()
            wait_for(lambda: craft.connection.link)
            do(craft)
            wait_for(lambda: craft.clock.now >= until * 1e9)
            craft.call(lambda: None).result()       # in its next turn
            return ([row["text"] for row in room.journal.rows("events", "craft") if "missing" in row["text"]],
                    craft.past.sessions()[-1]["gaps"], room.journal.rows("sent", "craft"))
        finally:
            room.close()

    def slow(craft):
        for t in range(1, 5):
            run.put(t, packet(t))
        wait_for(lambda: craft.clock.now >= 4 * 10**9)
        craft.call(lambda: craft.commanding.send("operator", "flight.noop", {}, False)).result()
        run.put(10, packet(10), lost=5)
        run.put(80, packet(80))

    events, gaps, (sent,) = served(80, slow)
    why = "5 messages of /flight/telemetry went lost on their way here"
    assert events == [f"telemetry is missing from 4 s to 10 s: {why}"]
    assert gaps == [["4000000000", "10000000000", why]]
    assert (sent["stages"][-1]["stage"], sent["stages"][-1]["good"]) == ("unknown", None)
    assert sent["stages"][-1]["text"] == \
        "unknown, telemetry is missing from 4 s to 10 s: no report of its execution within 60 s"

    def again(_):
        run.waiting.append((80 * 10**9, packet(80), run.counts))    # the last message comes to a new observer
        run.put(81, packet(81))

    del run.last
    events, gaps, _ = served(81, again)
    ended = "this program ended before the run, and there is no record of its messages here; what was sent later is"
    assert f"telemetry is missing from 80 s to 80 s: {ended} lost" in events and len(events) == 2
    assert gaps == [["80000000000", "81000000000", "restart; the session before: closed"]]

    def late(_):
        run.put(90, packet(90), lost=3)

    del run.last
    events, gaps, _ = served(90, late)
    assert "telemetry is missing from 81 s to 90 s: /flight/telemetry was not heard here" in events and len(events) == 4


def test_a_server_notes_what_a_lost_controller_had_not_passed_on(tmp_path, monkeypatch):
    run = Run()
    monkeypatch.setattr(member, "_bindings", lambda: run)
    monkeypatch.delenv("FLEDGE_EXCHANGE", raising=False)
    (tmp_path / "room.toml").write_text('folder = "room"\n[[craft]]\nname = "craft"\nmission = "nadir_spin"\n'
                                        'link = "cosim:flight"\n')
    room = Room(read_settings(tmp_path / "room.toml"))
    ours, theirs = socket.socketpair(type=socket.SOCK_SEQPACKET)
    with ours, theirs:
        craft = room.crafts["craft"]
        craft.control = Steered(Steering(theirs))
        ours.send(json.dumps({"t": 7.5}).encode())
        run.put(4, packet(4))
        craft.start()
        wait_for(lambda: craft.clock.now >= 4 * 10**9)
        run.gone = True
        wait_for(lambda: "gone" in craft.connection.state)
        why = craft.connection.state
        assert why.startswith("the controller is gone, and there is no record")
        assert craft.past.sessions()[-1]["gaps"] == [["4000000000", "7500000000", why]]     # at once
        events = [row["text"] for row in room.journal.rows("events", "craft")]
        assert f"telemetry is missing from 4 s to 7.5 s: {why}" in events and f"the link is down: {why}" in events
        run.gone = False
        wait_for(lambda: craft.connection.link)
        run.put(8, packet(8))
        wait_for(lambda: craft.clock.now >= 8 * 10**9)
        room.close()        # the run goes on without it
        history = Database.load(tmp_path / "room/databases/craft.xml").history(tmp_path / "room/archive", "craft")
        gaps = sorted(history.sessions()[-1]["gaps"])
        assert [gap[:2] for gap in gaps] == [(4 * 10**9, 7_500_000_000), (4 * 10**9, 8 * 10**9), (8 * 10**9, 8 * 10**9)]
        assert gaps[0][2] == why and gaps[1][2] == "/flight/telemetry was not heard here"
        assert gaps[2][2].startswith("this program ended before the run, and there is no record")

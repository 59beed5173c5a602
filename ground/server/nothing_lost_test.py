# SPDX-License-Identifier: Apache-2.0
"""The server as a process of its own, while what it depends on fails: packets in against packets found.

    FLEDGE_SOAK_S=3600 /usr/bin/python3 -m pytest -s ground/server/nothing_lost_test.py -k memory
"""
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
import sys
import time
from contextlib import contextmanager, suppress
from http.client import HTTPException
from threading import Thread
from types import SimpleNamespace
from unittest.mock import patch
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from fledge.commands import Stored
from fledge.ground.server import clock as clock_module, link, spacecraft
from fledge.ground.server.clock import Clock
from fledge.ground.server.journal import Journal, JournalError
from fledge.ground.server.room import Room
from fledge.ground.server.stored import StoredLists
from fledge.ground.server.settings import read
from fledge.errors import SetupError
from tests.circles import long_after
from tests.waiting import PATIENCE, wait_for

S = 10**9
SOAK = float(os.environ.get("FLEDGE_SOAK_S", "6"))      # [s]
DATABASE = """<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u16" signed="false"><IntegerDataEncoding sizeInBits="16"/></IntegerParameterType>
<IntegerParameterType name="u32" signed="false"><IntegerDataEncoding sizeInBits="32"/></IntegerParameterType>
<BinaryParameterType name="rest"><BinaryDataEncoding><SizeInBits><FixedValue>1600</FixedValue></SizeInBits>
</BinaryDataEncoding></BinaryParameterType></ParameterTypeSet><ParameterSet>
<Parameter name="stream" parameterTypeRef="u16"/><Parameter name="sequence" parameterTypeRef="u16"/>
<Parameter name="length" parameterTypeRef="u16"/><Parameter name="number" parameterTypeRef="u32"/>
<Parameter name="rest" parameterTypeRef="rest"/></ParameterSet><ContainerSet>
<SequenceContainer name="Packet"><EntryList><ParameterRefEntry parameterRef="stream"/>
<ParameterRefEntry parameterRef="sequence"/><ParameterRefEntry parameterRef="length"/>
<ParameterRefEntry parameterRef="number"/><ParameterRefEntry parameterRef="rest"/></EntryList></SequenceContainer>
</ContainerSet></TelemetryMetaData></SpaceSystem>"""


def packet(number):
    return struct.pack(">HHHI", 0x0801, 0xC000 | number & 0x3FFF, 203, number) + bytes(200)


class Craft:
    """A spacecraft that numbers its packets, and sends them to all who are connected."""

    def __init__(self):
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.ends, self.sent = [], 0

    def connected(self):
        self.socket.settimeout(PATIENCE)
        self.ends.append(self.socket.accept()[0])

    def send(self, n):
        """To each end that the other side has not closed."""
        for self.sent in range(self.sent + 1, self.sent + n + 1):
            for end in self.ends:
                with suppress(ConnectionError):
                    end.sendall(packet(self.sent))

    def drop(self):
        """Close all connections; in order, so that what was sent arrives, if somebody still reads."""
        for end in self.ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_WR)
                while end.recv(100):
                    pass
            end.close()
        self.ends.clear()

    def close(self):
        for end in [*self.ends, self.socket]:
            end.close()


@pytest.fixture
def craft():
    craft = Craft()
    yield craft
    craft.close()


class Server:
    """`fledge ground serve` in a folder, with a spacecraft at a port."""

    def __init__(self, folder, port, database=DATABASE):
        folder.mkdir(exist_ok=True)
        (folder / "craft.xml").write_text(database)
        (folder / "ground.toml").write_text(
            f'port = 0\nfolder = "out"\n[[craft]]\nname = "craft"\ndatabase = "craft.xml"\n'
            f'link = "tcp://127.0.0.1:{port}"\n')
        self.process = subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", "ground", "serve", "ground.toml"],
                                        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        loading, line = self.process.stdout.readline(), self.process.stdout.readline()
        assert "loading" in loading and "http" in line, loading + line + self.process.stdout.read()
        self.port = int(re.search(r":(\d+)/", line)[1])

    def get(self, path):
        with urlopen(f"http://127.0.0.1:{self.port}/api/{path}", timeout=PATIENCE) as response:
            return json.load(response)

    def put(self, path, content, method="PUT"):
        request = Request(f"http://127.0.0.1:{self.port}/api/{path}", json.dumps(content).encode(), method=method,
                          headers={"X-Fledge-CSRF": self.get("session")["csrf"], "Content-Type": "application/json"})
        with urlopen(request, timeout=PATIENCE) as answer:
            return json.load(answer)

    def until(self, path, holds):
        return wait_for(lambda: holds(rows := self.get(path)) and [rows], self.process,
                        lambda: f"{path} is {self.get(path)}; {self.get('crafts')}")[0]

    def took(self, n):
        """Wait until so many packets have come."""
        self.until("crafts", lambda crafts: crafts[0]["packets"] >= n)

    def numbers(self):
        """The numbers of the packets in the archive, in its order."""
        stretches = [(session["first_ns"], session["last_ns"]) for session in self.get("crafts/craft/sessions")]
        return [int(number) for begin, end in stretches for number in self.get(
            f"crafts/craft/history?names=number&points=0&from_ns={begin}&to_ns={end}")["number"]["value"]]

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def memory(self):
        """[MB]"""
        with open(f"/proc/{self.process.pid}/statm") as file:
            return int(file.read().split()[1]) * resource.getpagesize() / 1e6


@contextmanager
def serving(folder, craft, database=DATABASE):
    server = Server(folder, craft.port, database)
    try:
        craft.connected()
        yield server
    finally:
        server.process.send_signal(signal.SIGTERM)
        try:
            server.process.wait()
        finally:
            server.process.kill()
            server.process.stdout.close()


@pytest.mark.parametrize("seed", long_after(1, [1, 2, 3], "more draws"))
def test_what_anybody_has_seen_outlives_kill_9(tmp_path, craft, seed):
    chance = random.Random(seed)
    shown = []
    for _ in range(2):
        server = Server(tmp_path, craft.port)
        try:
            craft.connected()
            before = newest = craft.sent
            craft.send(chance.randrange(1, 2000))
            while newest == before:         # as a browser does
                for row in server.get("crafts/craft/packets?limit=1"):
                    newest = max(newest, int.from_bytes(bytes.fromhex(row["hex"])[6:10], "big"))
        finally:
            server.kill()
        shown += range(before + 1, newest + 1)
        craft.drop()
    with serving(tmp_path, craft) as server:
        craft.send(100)
        server.took(100)
        numbers = server.numbers()
        ended = [row["ended"] for row in server.get("crafts/craft/sessions")]
    print(f"{craft.sent} packets in, {len(shown)} shown before the ends, {len(numbers)} found")
    assert set(shown) <= set(numbers) and len(numbers) == len(set(numbers))
    assert numbers[-100:] == list(range(craft.sent - 99, craft.sent + 1))
    assert ended == ["killed", "killed", ""]


class Desk(Thread):
    """A user who sets limits, acknowledges and shelves an alarm, and looks at packets and events, until the server is
    gone: of each kind of request the number that was answered last, and that was asked last."""

    def __init__(self):
        super().__init__()
        self.n, self.requested, self.answered, self.answers = 1, {}, {"limits": 1, "note": 0, "shelved": 0}, 0
        self.newest, self.events = 0, set()

    def at(self, server):
        """The same user at the next server."""
        desk = Desk()
        desk.__dict__ |= {key: getattr(self, key) for key in ("n", "requested", "answered", "answers", "events")}
        desk.server = server
        desk.start()
        return desk

    def run(self):
        with suppress(OSError, HTTPException):
            while True:
                self.n += 1
                for what, path, method, content in (
                        ("limits", "limits/3", "PUT", {"limits": {"warning": [None, 1 / self.n]}}),
                        ("note", "alarms/3", "POST", {"acknowledge": True, "note": str(self.n)}),
                        ("shelved", "alarms/3", "POST", {"shelve_s": self.n})):
                    self.requested[what] = self.n
                    self.server.put(f"crafts/craft/{path}", content, method)
                    self.answered[what] = self.n
                    self.answers += 1
                for row in self.server.get("crafts/craft/packets?limit=1"):
                    self.newest = max(self.newest, int.from_bytes(bytes.fromhex(row["hex"])[6:10], "big"))
                self.events |= {row["id"] for row in self.server.get("crafts/craft/events") if row["id"]}


@pytest.mark.parametrize("cases", long_after(1, [int(os.environ.get("FLEDGE_CASES", "2")), 6], "more ends"))
def test_what_was_answered_outlives_kill_9_at_any_instant(tmp_path, craft, cases):
    """FLEDGE_CASES: at how many instants, each some seconds."""
    chance, shown, desk = random.Random(5), set(), Desk()
    for case in range(cases):
        server = Server(tmp_path, craft.port)
        try:
            craft.connected()
            if case == 0:
                server.put("crafts/craft/limits/3", {"limits": {"warning": [None, 1]}})
                craft.send(2)
                server.until("crafts/craft/alarms", lambda counts: counts)
            else:
                alarm, = server.get("crafts/craft/alarms")
                counts = {"note": int((alarm["acknowledged"] or {"note": 0})["note"])}
                counts["limits"] = round(1 / server.get("crafts/craft/slots")[3]["limits"]["warning"][1])
                for what, n in counts.items():
                    assert desk.answered[what] <= n <= desk.requested.get(what, n), (
                        what, n, desk.answered, desk.requested)
                with sqlite3.connect(f"file:{tmp_path}/out/journal.sqlite?mode=ro", uri=True) as journal:
                    assert desk.events <= {number for number, in journal.execute("SELECT id FROM events")}
                assert alarm["shelved_until_ns"] != "0" or not desk.answered["shelved"]
            begin, desk, end = craft.sent, desk.at(server), time.monotonic() + chance.uniform(0.02, 1)
            while time.monotonic() < end or (not desk.answers and desk.is_alive()):
                craft.send(chance.randrange(1, 200))
                time.sleep(0.01)
        finally:
            server.kill()
        desk.join()
        craft.drop()
        shown |= {*range(begin + 1, desk.newest + 1)}
    with serving(tmp_path, craft) as server:
        craft.send(1)
        server.took(1)
        counts = server.numbers()
        craft.drop()
    print(f"{cases} ends, {desk.answers} requests answered, {len(shown)} packets and {len(desk.events)} events shown, "
          f"{len(counts)} packets found")
    assert shown <= set(counts) and len(counts) == len(set(counts)) and desk.answers


def limits_of(folder):
    """The changes of limits that a second program finds in the journal."""
    with sqlite3.connect(f"file:{folder}/out/journal.sqlite?mode=ro", uri=True) as journal:
        return [json.loads(text) for text, in journal.execute("SELECT content FROM limits ORDER BY id")]


@pytest.mark.long("starts three servers")
def test_limits_that_were_set_outlive_kill_9_and_a_database_that_changes(tmp_path, craft):
    slot, limits = 3, {"warning": [None, 150.0], "critical": [-1.0, 250.0]}     # of number
    path = f"crafts/craft/limits/{slot}"
    server = Server(tmp_path, craft.port)
    try:
        craft.connected()
        craft.send(100)
        server.took(100)
        slot_state = server.put(path, {"limits": limits, "persistence": 2})
    finally:
        server.kill()
    craft.drop()
    assert (slot_state["name"], slot_state["limits"], slot_state["replaced"]) == ("number", limits, {})
    row, = limits_of(tmp_path)
    assert (row["limits"], row["persistence"], row["old"]["limits"], row["user"]) == (limits, 2, {}, "operator")

    def state(server, n):
        """Of number after so many packets, by an alarm."""
        craft.send(n)
        server.took(n)
        return {row["name"]: row["level"] for row in server.get("crafts/craft/alarms")}

    def events(server):
        return [row["text"] for row in server.get("crafts/craft/events") if row["source"] == "limits"]

    with serving(tmp_path, craft) as server:
        row = server.get("crafts/craft/slots")[slot]
        assert (row["limits"], row["persistence"], row["replaced"]) == (limits, 2, {})
        assert state(server, 50) == {} and not events(server)       # 101 to 150
        assert server.get("log")[0]["text"].startswith("number: none -> warning open to 150, critical -1 to 250, 2 in")
        craft.drop()
    unit = DATABASE.replace('name="u32" signed="false">', 'name="u32" signed="false"><UnitSet><Unit>s</Unit></UnitSet>')
    for database, text, level in (
            (DATABASE.replace('"number"', '"amount"'), "limits that were set for number wait", {}),
            (unit, "limits that operator set for number do not count: it was natural [], and is natural [s]", {}),
            (DATABASE, "", {"number": "warning"})):
        with serving(tmp_path, craft, database) as server:
            assert text in "".join(events(server)[:1]), events(server)
            assert state(server, 5) == level
            craft.drop()
    with serving(tmp_path, craft) as server:
        other = DATABASE.replace('signed="false"><IntegerDataEncoding sizeInBits="32"/>', """signed="false">
            <IntegerDataEncoding sizeInBits="32"/><DefaultAlarm><StaticAlarmRanges><WatchRange maxInclusive="1"/>
            </StaticAlarmRanges></DefaultAlarm>""")
        (tmp_path / "craft.xml").write_text(other)
        server.until("crafts/craft/events", lambda rows: "the database has other limits of number than before (watch "
                     "open to 1); those that operator set still count" in rows[0]["text"] + rows[1]["text"])
        assert state(server, 100)["number"] == "critical"           # 266 and more
        slot_state = server.put(path, {"limits": None})
        assert slot_state["limits"] == {"watch": [None, 1.0]} and slot_state["replaced"] is None
        assert server.get("crafts/craft/alarms")[0]["level"] == "watch"
        assert "critical -1 to 250, 2 in a row -> watch open to 1, as in the database" in server.get("log")[0]["text"]
        craft.drop()
    with serving(tmp_path, craft, other) as server:
        assert server.get("crafts/craft/slots")[slot]["limits"] == {"watch": [None, 1.0]}
    assert [row["limits"] for row in limits_of(tmp_path)] == [limits, None]


def test_an_alarm_ends_after_a_restart_by_the_values_that_come_then(tmp_path, craft):
    """Also if the parameter came back within its limits while no server looked, and others have begun and ended."""
    slot, path = 3, "crafts/craft/alarms"
    server = Server(tmp_path, craft.port)
    try:
        craft.connected()
        server.put(f"crafts/craft/limits/{slot}", {"limits": {"warning": [100, None]}})
        craft.send(10)
        server.until(path, lambda rows: rows and rows[0]["level"] == "warning")
        server.put(f"{path}/{slot}", {"acknowledge": True, "note": "seen"}, "POST")
    finally:
        server.kill()
    craft.drop()
    craft.send(100)         # no client reads them
    with sqlite3.connect(tmp_path / "out/journal.sqlite") as journal:
        ended = json.dumps(json.loads(journal.execute("SELECT content FROM alarms").fetchone()[0]) | {
            "name": "stream", "ended_ns": "1"})
        journal.executemany("INSERT INTO alarms (craft, t, content) VALUES ('craft', 0, ?)", [(ended,)] * 600)
    with serving(tmp_path, craft) as server:
        assert [row["level"] for row in server.get(path)] == ["warning"]
        craft.send(1)
        server.until(path, lambda rows: not rows)
        craft.drop()


def test_a_full_disk_keeps_no_request_and_loses_no_alarm(tmp_path, craft):
    """What a user wants is refused while it cannot be kept; what happens meanwhile is in the journal later."""
    path = "crafts/craft/alarms"
    with serving(tmp_path, craft) as server:
        server.put("crafts/craft/limits/3", {"limits": {"warning": [None, 100]}})
        pid = server.process.pid
        before = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (1, before[1]))
        craft.send(200)
        server.until(path, lambda rows: rows and rows[0]["level"] == "warning")
        # Its thread has tried to write all of it, once it has answered the request that follows.
        server.until("crafts", lambda rows: rows[0]["archive"])
        for what, method in ((f"{path}/3", "POST"), ("crafts/craft/limits/3", "PUT")):
            with pytest.raises(HTTPError) as refused:
                server.put(what, {"acknowledge": True} if method == "POST" else {"limits": None}, method)
            assert refused.value.code == 409 and "cannot be" in refused.value.read().decode()
        assert server.get(path)[0]["acknowledged"] is None
        resource.prlimit(pid, resource.RLIMIT_FSIZE, before)
        for what in ("the journal is written again", "the archive is written again: no packets are missing"):
            server.until("crafts/craft/events", lambda rows: any(row["text"] == what for row in rows))
        server.put(f"{path}/3", {"acknowledge": True, "note": "seen"}, "POST")
        shown = server.get(path), server.get("crafts/craft/events")
        server.kill()
    craft.drop()
    with serving(tmp_path, craft) as server:
        assert server.get(path) == shown[0]
        assert server.get("crafts/craft/slots")[3]["limits"] == {"warning": [None, 100]}
        events = {row["id"]: row for row in server.get("crafts/craft/events")}
        assert all(events[row["id"]] == row for row in shown[1])
        assert any("cannot be written" in row["text"] for row in shown[1])
        craft.send(1)
        server.took(1)
        assert server.numbers() == list(range(1, 202))


def test_each_spacecraft_tells_that_its_journal_was_written_again(tmp_path):
    """Also if events of the server itself were written before its own."""
    (tmp_path / "craft.xml").write_text(DATABASE)
    (tmp_path / "ground.toml").write_text('folder = "out"\n[[craft]]\nname = "craft"\ndatabase = "craft.xml"\n'
                                          'link = "tcp://127.0.0.1:1"\n')
    room = Room(read(tmp_path / "ground.toml"))
    try:
        with patch.object(room.journal, "save_all", side_effect=JournalError("it cannot be written")):
            room.report("craft", "info", "server", "x")
            room.report("", "info", "server", "y")
        room.report("", "info", "server", "z")
        room.flush("craft")
        for name, own in (("craft", ["x"]), ("", ["y", "z"])):
            assert {row["text"] for row in room.journal.rows("events", name)} == {
                *own, "it cannot be written", "the journal is written again"}
    finally:
        room.close()


@pytest.mark.long("waits for a link to return")
def test_a_link_that_breaks_costs_what_is_sent_meanwhile_and_no_more(tmp_path, craft):
    chance = random.Random(4)
    with serving(tmp_path, craft) as server:
        for n in (1, 2, 3):
            craft.send(chance.randrange(1, 500))
            craft.drop()
            server.until("crafts/craft/events", lambda rows: n == sum("link is down" in row["text"] for row in rows))
            craft.connected()
        craft.send(10)
        server.took(craft.sent)
        assert server.numbers() == list(range(1, craft.sent + 1))
        texts = [row["text"] for row in server.get("crafts/craft/events")]
        assert sum("link is down" in text for text in texts) == 3 and sum("link is up" in text for text in texts) == 4


def test_a_full_disk_is_reported_and_what_came_meanwhile_is_written_when_there_is_room(tmp_path, craft):
    """No file of the server may grow beyond its present size for a while."""
    with serving(tmp_path, craft) as server:
        craft.send(500)
        server.took(500)
        pid = server.process.pid
        before = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (50_000, before[1]))
        craft.send(2000)
        server.until("crafts", lambda rows: rows[0]["archive"] and rows[0]["packets"] == 2500)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, before)
        while server.get("crafts")[0]["archive"]:
            craft.send(1)
            time.sleep(0.1)
        server.took(craft.sent)
        assert server.numbers() == list(range(1, craft.sent + 1))


def test_two_servers_of_one_spacecraft_have_all_packets_and_one_folder_has_one_server(tmp_path, craft):
    with serving(tmp_path / "north", craft) as north, serving(tmp_path / "south", craft) as south:
        craft.send(1000)
        for server in (north, south):
            server.took(1000)
            assert server.numbers() == list(range(1, 1001))
        again = subprocess.run([sys.executable, "-P", "-m", "fledge.cli", "ground", "serve", "ground.toml"],
                               cwd=tmp_path / "north", capture_output=True, text=True)
        assert again.returncode == 2 and "another program" in again.stderr, again
        craft.send(10)
        north.took(1010)
        assert north.numbers() == list(range(1, 1011))


def test_steps_of_the_clock_lose_nothing(tmp_path, craft, monkeypatch):
    """A server in this process, whose clock the test sets: forward, back by less than a second, and by hours. A machine
    that stands still is no such step."""
    offset, still, stalls = [0], [0], []

    def time_ns():
        still[0] += stalls.pop() if stalls else 0
        return time.time_ns() + offset[0] + still[0]

    clock = SimpleNamespace(monotonic=time.monotonic, monotonic_ns=lambda: time.monotonic_ns() + still[0],
                            time_ns=time_ns)
    monkeypatch.setattr(clock_module, "time", clock)
    (tmp_path / "craft.xml").write_text(DATABASE)
    (tmp_path / "ground.toml").write_text(
        f'folder = "out"\n[[craft]]\nname = "craft"\ndatabase = "craft.xml"\nlink = "tcp://127.0.0.1:{craft.port}"\n')
    room = Room(read(tmp_path / "ground.toml"))
    spacecraft = room.crafts["craft"]
    try:
        room.start()
        craft.connected()
        for step in (0, 3600 * S, -S // 2, -7200 * S, 0, 10**6 * S):
            offset[0] += step
            stalls.append(5 * S)
            wait_for(lambda: not stalls)
            craft.send(200)
            wait_for(lambda: spacecraft.telemetry.packets >= craft.sent)
        sessions = spacecraft.telemetry.history.sessions()
        numbers = [int.from_bytes(each[3][6:10], "big") for session in sessions
                   for each in spacecraft.telemetry.history.packets(session=session["session"], limit=10_000)]
        assert numbers == list(range(1, craft.sent + 1)) and len(sessions) == 2
        texts = [row["text"] for row in room.journal.rows("events", "craft") if "clock went" in row["text"]]
        assert ["back by" in each for each in texts] == [False, True, False]
    finally:
        room.close()


@pytest.mark.parametrize("error", [RuntimeError("no such thing"), SystemExit(3)])
def test_a_thread_that_fails_is_reported_and_begins_again_alone(tmp_path, craft, capsys, monkeypatch,
                                                                error):
    for module in (link, spacecraft):
        monkeypatch.setattr(module, "AGAIN", 0.1)
    (tmp_path / "craft.xml").write_text(DATABASE)
    (tmp_path / "ground.toml").write_text('folder = "out"\n' + "".join(
        f'[[craft]]\nname = "{name}"\ndatabase = "craft.xml"\nlink = "tcp://127.0.0.1:{craft.port}"\n'
        for name in ("one", "two")))
    room, fails = Room(read(tmp_path / "ground.toml")), [1]
    first, second = room.crafts.values()

    def take(notes):
        if fails[0]:
            fails[0] -= 1
            raise error
        return begin(notes)

    def failed(why, wait):
        tell(why, wait)
        try:
            first.commanding.release("test", "x", {}, [b"x"])
        except SetupError as refused:
            seen.append((first.failed, first.describe()["failed"], str(refused)))

    begin, first.alarms.take = first.alarms.take, take
    seen, tell, first._fail = [], first._fail, failed
    try:
        room.start()
        craft.connected()
        craft.connected()
        first.call(lambda: first.limits.change("test", 3, {"warning": [None, 100]}, 1)).result(PATIENCE)
        craft.send(150)         # the alarm's note is lost with the error
        wait_for(lambda: seen)
        (shown, described, refused), = seen
        assert f"the server failed here: {type(error).__name__}: {error}; it tries again after 0." in shown == described
        assert "link is down" in refused
        craft.connected()
        wait_for(lambda: not first.failed and first.alarms.rows())
        craft.send(10)
        wait_for(lambda: second.telemetry.packets == 160)
        wait_for(lambda: any("works here again" in row["text"] for row in room.journal.rows("events", "one")))
        wait_for(lambda: first.telemetry.packets >= 10)
        assert [row["severity"] for row in room.journal.rows("events", "one")].count("critical") == 1
        assert not second.failed and len(room.journal.rows("events", "two")) == 1      # its link is up
        assert "Traceback" in capsys.readouterr().err
    finally:
        room.close()


def test_stored_commands_that_are_known_outlive_the_server(tmp_path):
    """Their lists, and when a sequence began; those of a simulation end with it."""
    journal = Journal(tmp_path)

    def lists(simulated):
        clock = Clock(simulated)
        clock.now = 100 * S
        reporter = SimpleNamespace(clock=clock, all=lambda kind: journal.all(kind, "craft"),
                                   keep=lambda kind, row, shown: journal.save(kind, "craft", row))
        return StoredLists("flight.stored", None, None, SimpleNamespace(slot_numbers={}), reporter)

    stored = lists(False)
    stored._names[7] = "flight.noop"
    stored._keep(0, [Stored(200 * S, 1, 20, 7, 0), Stored(150 * S, 2, 20, 8, 0)], str(90 * S))
    stored._keep(3, [Stored(5 * S, 0, 20, 7, 0)])
    stored._begun[3], stored._held[2] = 40 * S, 41 * S
    for number in (0, 2, 3):
        stored._save(number)
    again = lists(False)
    assert again.describe() == stored.describe()
    assert again.describe()["lists"][0]["commands"][1]["name"] == "flight.noop"
    assert (again._begun, again._held, again._names[7]) == (stored._begun, stored._held, "flight.noop")
    again._keep(0, [], str(95 * S))
    again._save(0)
    assert lists(False).describe() == again.describe() and len(journal.all("stored", "craft")) == 3
    assert all(not each["commands"] for each in lists(True).describe()["lists"])
    journal.close()


@pytest.mark.long("a server under load for seconds")
def test_memory_stays_as_it_is(tmp_path, craft, monkeypatch):
    """Under packets, and questions of browsers; FLEDGE_SOAK_S makes it longer."""
    # The address sanitizer would hold back 256 MB of what the server has freed, and its memory grow until then.
    monkeypatch.setenv("ASAN_OPTIONS", f"{os.environ.get('ASAN_OPTIONS', '')}:quarantine_size_mb=1")
    with serving(tmp_path, craft) as server:
        begin, first, requests = time.monotonic(), 0.0, 0
        while (spent := time.monotonic() - begin) < SOAK or requests < 600:
            craft.send(100)
            for path in ("crafts", "crafts/craft/packets?limit=20", "crafts/craft/sessions", "crafts/craft/events",
                         "crafts/craft/history?names=number&points=100"):
                server.get(path)
                requests += 1
            if not first and spent > SOAK / 3 and requests >= 200:
                first = server.memory()
            time.sleep(0.02)
        server.took(craft.sent)
        last = server.memory()
        print(f"{craft.sent} packets, {requests} requests in {spent:.0f} s: {first:.1f} MB after a third, "
              f"{last:.1f} MB")
        assert len(server.numbers()) == craft.sent and last < 1.1 * first + 8

# SPDX-License-Identifier: Apache-2.0
"""The control room of a co-simulation has every packet of the run, however busy the machine; what a killed server did
not hear is noted as a gap."""
import json
import os
import re
import signal
import struct
import subprocess
import time
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from urllib.request import Request, urlopen

import pytest

from fledge.archive import Archive
from fledge.ground.server.cosim_test import Flown
from fledge.ground.server.room import Room
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

    def __init__(self, folder, until, pace, compilers=2):
        super().__init__(folder, "linux", 0, until, 1, "exchange = true", 'on_loss = "restart"\n')
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
        record = Archive(self.folder / "runs/room/exchange.mcap")
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


class Run:
    """In place of the run's broker: messages of telemetry as a test puts them, with their counts."""

    NodeError = OSError
    topics: dict = {}
    reason = None
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
    assert len(events) == 1 and gaps == [["80000000000", "81000000000", "restart; the session before: closed"]]

    def late(_):
        run.put(90, packet(90), lost=3)

    del run.last
    events, gaps, _ = served(90, late)
    assert "telemetry is missing from 81 s to 90 s: /flight/telemetry was not heard here" in events and len(events) == 2

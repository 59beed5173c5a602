# SPDX-License-Identifier: Apache-2.0
"""One spacecraft of the control room. A thread of its own has the link: it gives what arrives to the monitor, in
batches, and does what others ask of the spacecraft by call(), so that nothing else touches the link, the commands or
the files."""
from __future__ import annotations

import sys
import time
import traceback
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event as Flag, Lock, Thread
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fledge.commands import SERVICES, Dictionary, Timed
from fledge.ground.server.alarms import Alarms
from fledge.ground.server.commanding import Commanding
from fledge.ground.server.contacts import Contacts
from fledge.ground.server.derived import DerivedParameters
from fledge.ground.server.limits import SetLimits
from fledge.ground.server.scene import Feed
from fledge.ground.server.services import StoredLists, Tables, Transfers
from fledge.ground.server.settings import CraftSettings
from fledge.errors import Failure, SetupError, did_you_mean, listed
from fledge.files import write_files
from fledge.ground import connect
from fledge.ground.scripts.address import open_link
from fledge.ground.scripts.craft import Craft, NoAnswer
from fledge.ground.database import Database
from fledge.ground.scripts.framed import Framed
from fledge.ground.scripts.links import Link
from fledge.records.series import stale_after

if TYPE_CHECKING:
    from fledge.ground.server.room import Room

Answer = TypeVar("Answer")

TURN = 20_000_000       # [ns] of a link's clock that one turn of the thread waits
AGAIN = 1.0             # [s] until a link that broke is opened again
BACK = 10**9            # [ns] by which the clock may step back within a session
REASONS = 50            # different ones of packets that are not decoded become events
AT_ONCE = 100_000       # packets of one time among which one is found by its id
LISTED = 1 << 22        # [bytes] of packets in a list, which ends then
RECENT = 500            # packets that are kept for a spacecraft without an archive
PATIENCE = 60.0         # [s] at most until the thread begins again; after as long without an error, soon
PICTURES = ("picture.webp", "picture.png", "picture.jpg")     # in a mission's folder
SEVERITIES = {"info": "info", "low": "watch", "medium": "warning", "high": "critical"}


class Spacecraft:
    """room: whose it is; index: its number in frames of values. Raises SetupError."""

    database: Database
    monitor: Any            #: of fledge.ground.Database.monitor()
    source: Spacecraft | None = None    # of which this is a replay
    replayed = ""           # its name

    def __init__(self, room: Room, settings: CraftSettings, index: int) -> None:
        self.room, self.settings, self.index = room, settings, index
        self.name = settings.name
        self.state = "not started"      #: of the link, in words
        self.link: Link | None = None   #: None: it is down
        self.ground: Craft | None = None    #: of a mission of Fledge: its commands, reports and files
        self.dictionary: Dictionary | None = None
        self.simulation: Any = None
        self.run: Any = None            #: of one that the server flies: its Pace
        #: how its run is controlled: that, or Steered of a co-simulation
        self.control: Any = room.steered if settings.link.startswith("cosim:") and not self.replayed else None
        self.mission_folder: Path | None = None
        self.picture: Path | None = None    #: of its mission
        self.epoch_ns: int | None = None
        self.now = 0                    #: [ns] of its clock: of the newest packet, or the link's time
        self._zero: int | None = None   # [ns] UTC of the steady clock's 0
        self.packets = self.undecoded = self.bytes = 0
        self.archive: Any = None        #: None: it is not kept
        self.history: Any = None
        self._reading = Lock()          # of the history
        self.failed = ""                #: by an error of the server itself, in words
        self.archive_problem, self._missed = "", 0    # packets of which an event has told
        self.recent: deque[tuple[int, int, bytes]] = deque(maxlen=RECENT)
        self.bad: deque[tuple[int, int, bytes, str]] = deque(maxlen=RECENT)     # those that were not decoded
        self.sinks: list[Callable[[list[tuple[int, int, bytes]]], None]] = []   #: get each batch after it is shown
        self.turns: list[Callable[[], None]] = []       #: are called in each turn of the thread
        self._asked: SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = SimpleQueue()
        self._over = Flag()
        self._thread: Thread | None = None
        self._reasons: set[str] = set()
        self._retry = 0.0
        self._opens = False     # the thread opens the link
        self.probed = False     #: a script's packet has waited to hear which number flight expects
        self._changed: dict[Path, int] = {}     # when the files of the database did
        self._mission_files: list[Path] = []    # that the mission was made of
        self._looked = self._published = 0.0
        #: [ns] in which telemetry of this session is missing
        self.gaps: deque[tuple[int, int]] = deque(maxlen=RECENT)
        self._untold: list[tuple[str, int]] = []        # of these, for an event
        self._last = -1         # [ns] of the newest packet of a co-simulation, also of the session before
        self._prepare()
        self.derived = DerivedParameters(self, self.monitor)
        self.slot_names: list[str] = []
        self.slot_numbers: dict[str, int] = {}
        self._watch()
        self.commanding: Commanding = Commanding(self)
        self.alarms = Alarms(self)
        self.limits = SetLimits(self)
        self.limits.begin()
        self.transfers, self.tables, self.stored = Transfers(self), Tables(self), StoredLists(self)
        if not self.replayed:
            self._keep()
        self._left_out()
        self.feed = Feed(self.name, self.simulation, self.monitor, flown=bool(self.run), link=lambda: self.link,
                         zero=0 if self.clock == "simulated" else self.epoch_ns or 0)   #: of the 3-D view
        used = dict(parse_qsl(urlsplit(settings.link).query)).get("radio", "") if settings.link else settings.radio
        self.contacts = Contacts(self.feed, self.simulation, used.rpartition(".")[2])

    @property
    def clock(self) -> str:
        """utc, or simulated: ns since the run's start."""
        return "simulated" if self.run or self.settings.link.startswith("cosim:") else "utc"

    @property
    def silent(self) -> str:
        """Why nothing can be sent now; empty: it can."""
        if self.link is None:
            return f"the link is down: {self.state}"
        # Reports of what flight repeats must not be taken for answers to what is sent now.
        return str(self.control.repeats(self.now / 1e9)) if self.control else ""

    # --- for all threads ---

    def start(self) -> None:
        self._see_time()
        self._thread = Thread(target=self._serve, name=self.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End in order."""
        self._over.set()
        end = time.monotonic() + 10
        # It takes no packet while it opens the link, for which a run that is over lets it wait long.
        while self._thread and self._thread.is_alive() and not self._opens and time.monotonic() < end:
            self._thread.join(timeout=0.05)
        if self.ground:
            self.ground.__exit__()
        elif self.link:
            self.link.close()
        self.ground = self.link = None
        self.monitor.sink(None)
        if self.archive is not None:
            try:
                self.archive.close()
            except SetupError as error:
                self._archived(str(error))
            self.archive = None

    def call(self, what: Callable[[], Answer]) -> Future[Answer]:
        """Do something in the spacecraft's thread."""
        made: Future[Answer] = Future()
        if self._over.is_set():
            made.set_exception(SetupError(f"{self.name} has ended"))
        else:
            self._asked.put((what, made))
        return made

    def told(self) -> dict[str, Any]:
        """The state for browsers."""
        link: dict[str, Any] = {"address": self.settings.link, "state": self.state, "up": self.link is not None}
        if self.link is not None:
            link |= {"skipped": self.link.skipped, "dropped": self.link.dropped} | getattr(self.link, "counts", {})
            link |= {"cop1": self.link.cop1} if isinstance(self.link, Framed) else {}
        if self.ground:
            link |= {"refused": self.ground.refused}
        can = [what for what, there in (
            ("command", not self.replayed), ("run", self.control), ("tables", self.dictionary and not self.replayed),
            ("files", self._has("Files")), ("stored", self._has("StoredCommands"))) if there]
        return {"name": self.name, "mission": Path(self.settings.mission).name, "index": self.index,
                "clock": self.clock, "epoch_ns": None if self.epoch_ns is None else str(self.epoch_ns),
                "simulated": bool(self.run), "replay": self.replayed, "link": link, "packets": self.packets,
                "undecoded": self.undecoded, "bytes": self.bytes, "t_ns": str(self.now), **self.contacts.told,
                "failed": self.failed, "archive": self.archive_problem, "can": can,
                "problem": self.room.journal.problem, "picture": self.picture is not None}

    def slots(self, first: int = 0, most: int = 2**32 - 1) -> list[dict[str, Any]]:
        """The parameters, as the monitor describes them. header: of the packet, or of a message of Fledge: its head,
        its time, its padding. stale: [s] the age at which a value is; None: it is not known."""
        outputs = [one.path for one in self.dictionary.outputs] if self.dictionary else []
        folded = (*(f"{path}.{part}" for path in outputs for part in ("head.", "spare")),
                  *(f"{self.dictionary.name}.{name}.{part}" for name in SERVICES for part in ("t", "spare")
                    if self.dictionary))
        stale = {path: stale_after(period) for path, period in self.feed.periods.items()}
        return [one | {"header": one["header"] or one["name"].startswith(folded),
                       "stale": stale.get(".".join(one["name"].split(".")[:2]))}
                for one in self.monitor.slots(first, most)]

    def inspect(self, packet: bytes) -> dict[str, Any]:
        """A packet in words."""
        found = dict(self.monitor.inspect(packet))
        found["rows"] = [[one.hex() if isinstance(one, bytes) else one for one in row] for row in found["rows"]]
        return found | {"hex": packet.hex(), "size": len(packet)}

    def packet_list(self, before: int, limit: int, container: str | None, undecoded: bool) -> list[dict[str, Any]]:
        """The newest packets first, whose t is `before` at most."""
        rows: list[tuple[int, int, str | None, bytes, str]] = []
        if self.history is not None:
            with self._reading:
                found = self.history.packets(
                    0, before, "undecoded" if undecoded else container or None, limit, True, most_bytes=LISTED)
            rows += ((t, received, name, packet, self.monitor.inspect(packet)["reason"] if name is None else "")
                     for t, received, name, packet in found)
        elif undecoded:
            rows += [(t, received, None, packet, reason) for t, received, packet, reason in reversed(self.bad)
                     if t <= before][:limit]
        else:
            for t, received, packet in reversed(self.recent):
                seen = self.monitor.inspect(packet)
                if t <= before and container in (None, "", seen["container"]) and len(rows) < limit:
                    rows.append((t, received, seen["container"], packet, seen["reason"]))
        return [{"id": number_of(t, packet), "t_ns": str(t), "received_ns": str(received), "container": name,
                 "size": len(packet), "reason": reason, "hex": packet.hex()}
                for t, received, name, packet, reason in rows]

    def packet_of(self, number: str) -> dict[str, Any] | None:
        """The packet of a list's `id` in words."""
        text = number.partition("-")[0]
        if self.history is not None and text.isdigit() and int(text) < 2**63:
            rows: Iterable[tuple[int, int, bytes]] = self._at(int(text))
        else:
            rows = [*self.recent, *((t, received, packet) for t, received, packet, _ in self.bad)]
        return next((self.inspect(packet) | {"id": number, "t_ns": str(t), "received_ns": str(received)}
                     for t, received, packet in rows if number_of(t, packet) == number), None)

    def _at(self, t: int) -> Iterator[tuple[int, int, bytes]]:
        """The packets of a time: also of sessions before, whose time others of a simulation or of a clock that went
        back have again."""
        with self._reading:
            earlier = [one["session"] for one in self.history.sessions() if one["first"] <= t <= one["last"]]
        for session in (-1, *reversed(earlier)):
            with self._reading:
                rows = self.history.packets(t, t, None, AT_ONCE, False, session)
            yield from ((t, received, packet) for t, received, _, packet in rows)

    def sessions(self) -> list[dict[str, Any]]:
        """What the archive has."""
        with self._reading:
            return [{"session": one["session"], "first_ns": str(one["first"]), "last_ns": str(one["last"]),
                     "packets": one["packets"], "ended": one["ended"],
                     "gaps": [[str(begin), str(end), why] for begin, end, why in one["gaps"]]}
                    for one in self.history.sessions()]

    def series(self, names: list[str], begin: int, end: int, points: int, session: int,
               exact: bool = False) -> dict[str, Any]:
        """name -> (t [ns], value, low, high, concern, worst), arrays, and (kind, exact values) of what the archive has,
        by the limits that were in force. Raises SetupError."""
        plain = [one for one in names if one not in self.derived]
        with self._reading:
            limits = {name: self.limits.of(name) for name in plain}
            found = self.history.series(plain, begin, end, points, session, limits, exact) if plain else {}
            return {name: found[name] if name in found else self.derived.series(
                name, self.history, begin, end, session, points) for name in names}

    def _has(self, service: str) -> bool:
        return bool(self.dictionary and not self.replayed and service in {one.type for one in self.dictionary.blocks})

    # --- beginning ---

    def _prepare(self) -> None:
        """The database, and what it is of."""
        settings = self.settings
        files = list(settings.database)
        if settings.mission:
            files = [self._mission()]
        self.database = Database.load(*files, lenient=settings.lenient)
        self.monitor = self.database.monitor(settings.root)
        self._changed = self._times()

    def _left_out(self) -> None:
        if left := self.database.left_out:
            self.room.tell(self.name, "warning", "database", f"{len(left)} things of the database are left out: "
                           f"{'; '.join(left[:3])}{'; ...' * (len(left) > 3)}")

    def _times(self) -> dict[Path, int]:
        """When the files of the database, or of the mission, and of derived parameters were written."""
        folder = self.room.settings.file.resolve().parent
        files = [*self.settings.database, *(folder / one.function.rpartition(":")[0] for one in self.settings.derived
                                            if one.function)]
        files += self._mission_files
        if self.mission_folder:
            files += self.mission_folder.glob("ground.toml")
        try:
            return {one: one.stat().st_mtime_ns for one in files}
        except OSError:
            return self._changed        # it is being written

    def _keep(self) -> None:
        """Archive what comes. Raises SetupError if another program does."""
        folder = self.room.settings.folder / "archive"
        self.archive, self._missed = self.database.archive(folder, self.name), 0
        self.monitor.sink(self.archive)
        self.history = self.database.history(folder, self.name, self.settings.root)
        if self.settings.link.startswith("cosim:") and not self.packets and (before := self.history.sessions()):
            self._last = before[-1]["last"]

    def _reread(self) -> None:
        """Take a database that has changed; a wrong one is refused, and the old one stays. What a mission was made of
        cannot be taken while it flies."""
        if time.monotonic() - self._looked < AGAIN or self.archive_problem:    # which still has to take packets
            return
        self._looked, before, self._changed = time.monotonic(), self._changed, self._times()
        if self._changed == before:
            return
        if self.settings.mission:
            names = sorted({path.name for path, _ in before.items() ^ self._changed.items()})
            self.room.tell(self.name, "warning", "database", f"the mission has changed ({listed(names)}); the server "
                           "has the old one until it starts again")
            return
        try:
            database = Database.load(*self.settings.database, lenient=self.settings.lenient)
            monitor = database.monitor(self.settings.root)
            derived = DerivedParameters(self, monitor)
        except (SetupError, OSError) as error:
            self.room.tell(self.name, "critical", "database",
                           f"the changed database is refused, the old one stays: {error}")
            return
        with self._reading:
            self.monitor.sink(None)
            try:
                self.archive.close()
            except SetupError as error:
                self.monitor.sink(self.archive)
                self._changed = before
                self._archived(str(error))
                return
            self.database, self.monitor, self.derived = database, monitor, derived
            self._keep()
        self._watch()
        self.limits.begin()
        self.alarms.anew()
        self.commanding.load()
        self.room.tell(self.name, "info", "database", f"the database has changed and was read anew: "
                       f"{len(self.slot_names)} parameters")
        self._left_out()
        self.room.publish("slots", self.name, {"first": 0})

    def _mission(self) -> Path:
        """Load the mission and write its database; the file of XTCE."""
        from fledge.ground.server.simulated import Pace, epoch_of, loaded
        from fledge.export import ground as of_ground, packets, read
        from fledge.export.xtce import xtce
        from fledge.ground.scripts.simulated import flight_of

        settings = self.settings
        sim = loaded(settings)
        process = flight_of(sim, settings.process)
        self.epoch_ns = epoch_of(sim)
        self.mission_folder = Path(sim.mission.folder) if sim.mission else None
        own = [one for name, one in sys.modules.copy().items() if name.startswith(f"_mission_{sim.name}_")]
        self._mission_files = sorted({Path(path) for one in own if (path := getattr(one, "__file__", None))})
        files = [self.mission_folder / name for name in PICTURES] if self.mission_folder else []
        self.picture = next((one for one in files if one.is_file()), None)
        self.dictionary = process.commands.dictionary
        self.simulation = sim
        if settings.radio and settings.radio not in sim.world.instances:
            raise SetupError(f"{self.name}: the world of {sim.name} has no radio '{settings.radio}'"
                             f"{did_you_mean(settings.radio, sim.world.instances)} it has "
                             + listed(list(sim.world.instances)))
        if not settings.link:
            self.run = self.control = Pace(sim, settings.speed)
        database = packets.database(read(sim, process.name))
        more = of_ground.read(self.mission_folder, [database])
        text = {f"{self.name}.xml": xtce(sim.name, [database], more)}
        return Path(next(iter(write_files(text, self.room.settings.folder / "databases"))))

    def _watch(self) -> None:
        """Let the monitor note each packet that flight's own services need."""
        self.slot_names = [one["name"] for one in self.monitor.slots(0)]
        self.slot_numbers = {name: i for i, name in enumerate(self.slot_names)}
        if self.dictionary is None:
            return
        process = self.dictionary.name
        names = self.database.container_names()
        wanted = {f"{process}.{one}" for one in ("reports", "texts", *SERVICES)}
        outputs = {one.path for one in self.dictionary.outputs}
        events = {f"{one.path}.{event.name}" for one in self.dictionary.outputs for event in one.events}
        self.monitor.watch([path for path, name in names.items() if name in wanted - outputs or name in events])

    # --- the thread ---

    def _serve(self) -> None:
        """The thread. An error that nobody has foreseen, of ours or of a mission's own Python, is told, and it begins
        again, later each time."""
        wait, begun = AGAIN, time.monotonic()
        while not self._over.is_set():
            try:
                self._work()
            except BaseException as error:      # sys.exit() of a mission's Python, too
                traceback.print_exception(error)
                wait = AGAIN if time.monotonic() - begun > PATIENCE else min(2 * wait, PATIENCE)
                with suppress(Exception):
                    self._failed(f"{type(error).__name__}: {error}", wait)
                begun = time.monotonic() + wait
                while time.monotonic() < begun and not self._over.is_set():
                    with suppress(BaseException):
                        self._answer()
                    self._over.wait(TURN / 1e9)

    def _failed(self, why: str, wait: float) -> None:
        """Say in red that the server itself has failed here, and close the link."""
        self.failed = f"the server failed here: {why}; it tries again after {wait:g} s"
        self.room.tell(self.name, "critical", "server", self.failed)
        if not self.run:        # whose link is the simulation
            self._broke(why)
        self.room.publish("craft", self.name, self.told())

    def _work(self) -> None:
        while not self._over.is_set():
            try:
                if self.link is None and time.monotonic() >= self._retry:
                    self._opens = True
                    try:
                        self._open()
                    finally:
                        self._opens = False
                if not self._over.is_set():
                    self._turn()
            except OSError as error:
                self._broke(error.strerror or str(error))
            except (SetupError, NoAnswer, Failure) as error:
                self._broke(str(error))
            else:
                if self.failed:
                    self.alarms.compare()       # whose notes may have been lost
                    self.failed = ""
                    self.room.tell(self.name, "info", "server", "the server works here again")
                    self.room.publish("craft", self.name, self.told())

    def _open(self) -> None:
        """Open the link. Raises OSError or SetupError."""
        settings = self.settings
        if self.dictionary is None:
            self.link = open_link(settings.link)
        else:
            radio = getattr(self.simulation.world, settings.radio) if settings.radio else None
            made = connect(self.simulation, process=settings.process, radio=radio, keys=settings.keys,
                           role=settings.role) if self.run else connect(
                settings.link, self.dictionary, keys=settings.keys, role=settings.role)
            self.link = made.link
            if self.ground is None:
                self.ground = made
            else:
                self.ground.link = made.link
                self.transfers.lost("the link broke")
        self.state = "up"
        if settings.link.startswith("cosim:"):
            getattr(self.link, "link", self.link).wait = TURN / 1e9
        self.room.tell(self.name, "info", "link", f"the link is up: {settings.link or 'the server flies it'}")
        self.room.publish("craft", self.name, self.told())
        if self.run and self.ground and not self.ground.sent and not settings.radio:
            self.commanding.release("server", "telemetry", {}, self.ground.made("telemetry"))

    def _broke(self, why: str) -> None:
        """The link is gone, or cannot be opened."""
        self._retry = time.monotonic() + AGAIN
        if self.link is not None:
            with suppress(Exception):
                self.link.close()
        if self.link is not None or self.state != why:
            self.state = why
            self.room.tell(self.name, "warning", "link", f"the link is down: {why}")
        self.link = None
        if self.run:        # a simulation that has failed does not go on
            self._retry = float("inf")
        self.room.publish("craft", self.name, self.told())

    def _turn(self) -> None:
        """Carry out the requests of other threads, and take the packets that arrive."""
        self._answer()
        self._reread()
        if time.monotonic() - self._published > AGAIN:      # pages show its time and counts without asking
            self._published = time.monotonic()
            self.contacts.look()
            self.alarms.look()
            self.room.flush(self.name)
            if self.archive_problem:        # also if the craft is silent
                self.noted(self.monitor.take([]))
                if self.archive_problem and not self.archive.problem:
                    self._archived("")
            self.room.publish("craft", self.name, self.told())
            if self.control:
                self.room.publish("run", self.name, self.control.told(self.state if self.link is None else ""))
        for turn in self.turns:
            turn()
        until = None
        if self.link is not None:
            until = self.run.until() if self.run else self.link.t + TURN
        if self.link is None or until is None:
            self.commanding.look()
            self._over.wait(TURN / 1e9)
            return
        arrived = self.ground.receive(until) if self.ground else self.link.receive(until)
        if self.clock == "simulated":
            self.now = max(self.now, self.link.t)
        rows = self._timed(arrived) if arrived else []
        for begin, end, why in getattr(self.link, "link", self.link).gaps():
            rows = self._lost(begin, end, why, rows)
        if self.commanding.left and (rows or self.clock == "utc"):
            self.commanding.restore()
        if rows:
            self.take(rows)
            self._last = rows[-1][0]
        while self._untold:     # the archive has them now
            self.room.tell(self.name, "warning", "link", *self._untold.pop(0))
        self.commanding.look()
        self.transfers.look()
        self.feed.sample()

    def _answer(self) -> None:
        """Carry out the requests of other threads."""
        self._see_time()
        try:
            while True:
                what, answer = self._asked.get_nowait()
                if not answer.set_running_or_notify_cancel():   # the asker was told that it is not done
                    continue
                try:
                    answer.set_result(what())
                except BaseException as error:  # is the asker's
                    answer.set_exception(error)
        except Empty:
            pass

    def _see_time(self) -> None:
        """Advance the clock of a craft by UTC, which goes on while the craft is silent. What waits for a time waits as
        long when somebody sets the server's clock."""
        if self.clock != "utc" or self.replayed:
            return
        begin = now = 0
        while not now or time.monotonic_ns() - begin > BACK // 10:      # the machine stood still between the two
            begin, now = time.monotonic_ns(), time.time_ns()
        zero = now - begin
        if self._zero is None:
            self._zero = zero
        if abs(step := zero - self._zero) > BACK:
            self._zero = zero
            self.now = max(0, self.now + step)
            self.commanding.stepped(step)
            self.alarms.stepped(step)
            self.room.tell(self.name, "warning", "server", f"the clock went {'back' if step < 0 else 'forward'} by "
                           f"{abs(step) / 1e9:g} s" + ": a new session begins" * (step < 0))
        self.now = max(self.now, now)

    def _lost(self, begin: int, end: int, why: str, rows: list[tuple[int, int, bytes]]
              ) -> list[tuple[int, int, bytes]]:
        """Note that packets of a co-simulation are missing; those that came, without what the archive has already."""
        follows = not self.packets and 0 <= self._last      # a session that began before: the archive knows the gap
        if begin < 0:
            if self.control and end <= self.control.past * 1e9:
                return rows
            begin = max(self._last, 0)
            if end <= begin:    # the run's last message comes again
                with self._reading:
                    known = {(t, packet) for t, _, _, packet in self.history.packets(rows[0][0], begin)} if rows else ()
                return [one for one in rows if (one[0], one[2]) not in known]
        if not follows:
            self.archive.missing(begin, end, why)
        self.gaps.append((begin, end))
        self._untold.append((f"telemetry is missing from {begin / 1e9:g} s to {end / 1e9:g} s: {why}", end))
        return rows

    def missing(self, begin: int, end: int) -> str:
        """In words, which telemetry of a stretch [ns] is missing; empty: none."""
        found = [(a, b) for a, b in self.gaps if a < end and begin < b]
        words = [f"from {self._in_words(a)} to {self._in_words(b)}" for a, b in found]
        return f"telemetry is missing {listed(words)}" if words else ""

    def _in_words(self, t: int) -> str:
        """A time [ns] of its clock."""
        return f"{t / 1e9:g} s" if self.clock == "simulated" else \
            datetime.fromtimestamp(t / 1e9, timezone.utc).strftime("%Y-%m-%d %H:%M:%S UTC")

    def _timed(self, arrived: list[Timed]) -> list[tuple[int, int, bytes]]:
        """(t, received, packet) of each."""
        assert self.link is not None
        self._see_time()
        received = time.time_ns()
        if self.clock == "simulated":
            return [(max(one.t, 0), received, one.packet) for one in arrived]
        offset = received - self.link.t
        rows = [(one.t + offset, one.t + offset, one.packet) for one in arrived]
        if 0 < self.now - rows[0][0] <= BACK:
            rows = [(max(t, self.now), received, packet) for t, received, packet in rows]
        return rows

    def take(self, rows: list[tuple[int, int, bytes]]) -> None:
        """Archive and decode a batch of packets, then handle its notes."""
        self.recent.extend(rows[-RECENT:])
        notes = self.monitor.take(rows)
        self.now = max(self.now, rows[-1][0]) if self.clock == "simulated" else rows[-1][0]
        self.noted(notes)
        self.noted(self.derived.turn())
        self.packets += len(rows)       # when they are in the archive, and their alarms known
        self.bytes += sum(len(packet) for _, _, packet in rows)
        for sink in list(self.sinks):       # the event loop changes it
            sink(rows)

    def noted(self, notes: Iterable[tuple[Any, ...]]) -> None:
        """What a batch had that is notable."""
        concerns: list[tuple[int, int, int, int]] = []
        for note in notes:
            what, *rest = note
            if what == "concern":
                concerns.append(tuple(rest))    # type: ignore[arg-type]
            elif what == "undecoded":
                self._undecoded(*rest)
            elif what == "watched":
                self._watched(*rest)
            elif what == "verified":
                self.commanding.verifying.take(*rest)
            elif what == "slots":
                more = self.monitor.slots(rest[0])
                self.slot_numbers |= {one["name"]: one["slot"] for one in more}
                self.slot_names += [one["name"] for one in more]
                self.noted(self.limits.in_force.learn(rest[0]))
                self.room.publish("slots", self.name, {"first": rest[0]})
            elif what == "archive":
                self._archived(rest[0])
            elif what == "full":
                self.room.tell(self.name, "critical", "server", rest[0])
        if concerns:
            self.alarms.take(concerns)

    def _undecoded(self, t: int, received: int, packet: bytes, reason: str) -> None:
        self.undecoded += 1
        self.bad.append((t, received, packet, reason))
        if reason not in self._reasons and len(self._reasons) < REASONS:
            self._reasons.add(reason)
            self.room.tell(self.name, "warning", "server",
                           f"a packet of {len(packet)} bytes was not decoded: {reason}", t)

    def _watched(self, _: str, t: int, received: int, packet: bytes) -> None:
        if self.ground is None:
            return
        self.ground.take(packet)
        for event in self.ground.events:
            self.room.tell(self.name, SEVERITIES.get(event.severity, event.severity), event.output, event.text, event.t)
        for text in self.ground.texts:
            self.room.tell(self.name, "info", text.kind.name.lower(), text.text, text.t)
        self.ground.events.clear()
        self.ground.texts.clear()

    def _archived(self, problem: str) -> None:
        missing = self.archive.lost - self._missed if self.archive is not None else 0
        if not problem:
            self._missed += missing
        self.archive_problem = problem
        self.room.tell(self.name, "critical" if problem or missing else "info", "archive", problem or
                       f"the archive is written again: {missing or 'no'} packets are missing")
        self.room.publish("craft", self.name, self.told())


def number_of(t: int, packet: bytes) -> str:
    """By which a packet is found again."""
    return f"{t}-{zlib.crc32(packet):08x}"

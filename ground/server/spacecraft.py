# SPDX-License-Identifier: Apache-2.0
"""One spacecraft of the control room, of its parts: link, telemetry, commands, alarms, files. A thread of its own has
the link: it gives what arrives to the monitor, in batches, and does what others request by call(), so that no other
thread touches the link, the commands or the files."""
from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event as Flag, Thread
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fledge.errors import Failure, SetupError
from fledge.ground.database import Database
from fledge.ground.scripts.craft import NoAnswer
from fledge.ground.scripts.member import Onlooker
from fledge.ground.server.alarms import Alarms
from fledge.ground.server.clock import Clock, Packets
from fledge.ground.server.commanding import Commanding
from fledge.ground.server.contacts import Contacts
from fledge.ground.server.limits import SetLimits
from fledge.ground.server.link import AGAIN, TURN, Connection
from fledge.ground.server.mission import LoadedMission
from fledge.ground.server.modes import Modes
from fledge.ground.server.past import Past
from fledge.ground.server.reporter import Reporter
from fledge.ground.server.run_control import Pace, RunControl
from fledge.ground.server.scene import Feed, periods_of
from fledge.ground.server.settings import CraftSettings
from fledge.ground.server.stored import StoredLists
from fledge.ground.server.tables import Tables
from fledge.ground.server.telemetry import Note, Telemetry
from fledge.ground.server.transfers import Transfers

if TYPE_CHECKING:
    from fledge.ground.server.room import Room
    from fledge.mission.simulation import Simulation

Answer = TypeVar("Answer")

LAST = 1.0              # [s] for a co-simulation that ends with the server to send its last packets
PATIENCE = 60.0         # [s] at most until the thread begins again; after as long without an error, soon
OF_FLIGHT = {"low": "watch", "medium": "warning", "high": "critical"}     # severities of flight, as here


class Spacecraft:
    """A spacecraft of a room. index: its number in frames of values; source: the spacecraft that it replays, or None.
    Raises SetupError."""

    clock: Clock
    limits: SetLimits
    simulation: Simulation | None   #: of its mission, or of that of the source
    telemetry: Telemetry

    def __init__(self, room: Room, settings: CraftSettings, index: int, source: Spacecraft | None = None) -> None:
        self.room, self.settings, self.index, self.source = room, settings, index, source
        self.name = settings.name
        self.failed = ""        #: by an error of the server itself, in words
        self.probed = False     #: a script's packet has waited for the number that flight expects
        self._requests: SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = SimpleQueue()
        self._over = Flag()
        self._thread: Thread | None = None
        self._published = 0.0

        mission = self.mission = LoadedMission.load(settings) if settings.mission and not source else None
        self.simulation = source.simulation if source else mission.simulation if mission else None
        self.epoch_ns: int | None = source.epoch_ns if source else mission.epoch_ns if mission else None
        #: of one that the server flies
        self.run = Pace(mission.simulation, settings.speed) if mission and not settings.link else None
        in_cosimulation = settings.link.startswith("cosim:")
        self.control: RunControl | None = self.run or (room.steered if in_cosimulation and not source else None)
        clock = self.clock = Clock(source.clock.simulated if source else bool(self.run) or in_cosimulation, not source)
        reporter = self.reporter = Reporter(room, self.name, clock)
        folder, dictionary = room.settings.folder, mission.dictionary if mission else None
        blocks = dictionary.blocks if dictionary else []

        database = source.telemetry.database if source else Database.load(
            *([mission.write_database(self.name, folder / "databases")] if mission else settings.database),
            lenient=settings.lenient)
        changes = source.limits.changes if source else reporter.all("limits")
        telemetry = self.telemetry = Telemetry(
            settings, database, mission, room.settings.file.resolve().parent, reporter, changes,
            periods_of(self.simulation) if self.simulation else {}, self.publish)
        link = self.connection = Connection(settings, clock, mission, bool(self.run), self.control)
        self.limits = SetLimits(changes, telemetry, reporter, bool(source), self.handle)
        self.past = Past(telemetry, self.limits)
        commanding = self.commanding = Commanding(settings, dictionary, bool(self.run), link, telemetry, self.past,
                                                  reporter)
        self.alarms = Alarms(telemetry, reporter)
        self.modes = None if source else Modes(telemetry.monitor, reporter)    #: None: the source has the events
        self.limits.begin()
        self.transfers = Transfers(folder / "files" / self.name, settings.light_time, link, reporter)
        self.tables = Tables(blocks, link, commanding, reporter)
        self.stored = StoredLists(next((block.path for block in blocks if block.type == "StoredCommands"), ""), link,
                                  commanding, telemetry, reporter)
        if not source:
            telemetry.keep(folder / "archive")
        telemetry.report_left_out()
        self.feed = Feed(self.name, self.simulation, telemetry.monitor, flown=bool(self.run),
                         link=lambda: link.carrier, zero=0 if clock.simulated else self.epoch_ns or 0)  #: of the view
        used = dict(parse_qsl(urlsplit(settings.link).query)).get("radio", "") if settings.link else settings.radio
        self.contacts = Contacts(self.feed, self.simulation, used.rpartition(".")[2])

    # --- for all threads ---

    def start(self) -> None:
        self._advance()
        self._thread = Thread(target=self._serve, name=self.name, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Begin to end; close() waits for it."""
        self._over.set()

    def close(self) -> None:
        """End in order."""
        self.end()
        end = time.monotonic() + 10
        # It takes no packet while it opens the link, for which a run that is over lets it wait long.
        while self._thread and self._thread.is_alive() and not self.connection.opening and time.monotonic() < end:
            self._thread.join(timeout=0.05)
        self.connection.close()
        self.telemetry.close()

    def call(self, request: Callable[[], Answer]) -> Future[Answer]:
        """Do something in the spacecraft's thread."""
        answer: Future[Answer] = Future()
        if self._over.is_set():
            answer.set_exception(SetupError(f"{self.name} has ended"))
        else:
            self._requests.put((request, answer))
        return answer

    def describe(self) -> dict[str, Any]:
        """The state for browsers."""
        mission = self.mission
        can = [what for what, there in (
            ("command", not self.source), ("run", self.control), ("tables", mission),
            ("files", mission and mission.has("Files")), ("stored", mission and mission.has("StoredCommands")))
            if there]
        return {"name": self.name, "mission": Path(self.settings.mission).name, "index": self.index,
                "clock": self.clock.kind, "epoch_ns": None if self.epoch_ns is None else str(self.epoch_ns),
                "simulated": bool(self.run), "replay": self.source.name if self.source else "",
                "link": self.connection.describe(), "t_ns": str(self.clock.now), **self.telemetry.describe(),
                **self.contacts.state, "failed": self.failed, "can": can, "problem": self.reporter.problem,
                "picture": bool(mission and mission.picture)}

    def describe_run(self) -> dict[str, Any] | None:
        """The state of the run for browsers; None: the spacecraft is in none that can be controlled."""
        if self.control is None:
            return None
        return self.control.describe(self.connection.state if self.connection.link is None else "")

    def publish(self) -> None:
        """Send the state to browsers."""
        self.reporter.publish("craft", self.describe())

    # --- the thread ---

    def _serve(self) -> None:
        """The thread. After an unforeseen error, of the server or of a mission's own Python, it begins again, later
        each time."""
        wait, begun = AGAIN, time.monotonic()
        while not self._over.is_set():
            try:
                self._work()
            except BaseException as error:      # sys.exit() of a mission's Python, too
                traceback.print_exception(error)
                wait = AGAIN if time.monotonic() - begun > PATIENCE else min(2 * wait, PATIENCE)
                with suppress(Exception):
                    self._fail(f"{type(error).__name__}: {error}", wait)
                begun = time.monotonic() + wait
                while time.monotonic() < begun and not self._over.is_set():
                    with suppress(BaseException):
                        self._answer()
                    self._over.wait(TURN / 1e9)
        self._finish()

    def _finish(self) -> None:
        """Take what a co-simulation, which mostly ends with the server, has sent."""
        run, end = self.connection.carrier, time.monotonic() + LAST
        if not isinstance(run, Onlooker):
            return
        run.hurry()
        try:
            while True:
                if run.goes_on and time.monotonic() > end:
                    run.leave()
                self._turn()
        except (OSError, SetupError, NoAnswer, Failure) as error:
            self._break(str(error))

    def _fail(self, why: str, wait: float) -> None:
        """Report that the server itself has failed here, and close the link."""
        self.failed = f"the server failed here: {why}; it tries again after {wait:g} s"
        self.reporter.event("critical", "server", self.failed)
        if not self.run:        # then the simulation is the link
            self._break(why)
        self.publish()

    def _work(self) -> None:
        while not self._over.is_set():
            try:
                if self.connection.due:
                    self._open()
                if not self._over.is_set():
                    self._turn()
            except OSError as error:
                self._break(error.strerror or str(error))
            except (SetupError, NoAnswer, Failure) as error:
                self._break(str(error))
            else:
                if self.failed:
                    self.alarms.compare()       # notes may have been lost
                    self.failed = ""
                    self.reporter.event("info", "server", "the server works here again")
                    self.publish()

    def _open(self) -> None:
        """Open the link. Raises OSError or SetupError."""
        if self.connection.open():
            self.transfers.lost("the link broke")
        self.reporter.event("info", "link", f"the link is up: {self.settings.link or 'the server flies it'}")
        self.publish()
        craft = self.connection.craft
        if self.run and craft and not craft.sent and not self.settings.radio:
            self.commanding.release("server", "telemetry", {}, craft.packets("telemetry"))

    def _break(self, why: str) -> None:
        """The link is gone, or cannot be opened."""
        self._lost([])
        self.handle(self.telemetry.retry())
        self.telemetry.report_gaps()
        if self.connection.broke(why):
            self.reporter.event("warning", "link", f"the link is down: {why}")
        self.publish()

    def _turn(self) -> None:
        """Carry out the requests of other threads, and take the packets that arrive."""
        self._answer()
        if self.telemetry.reload():
            self._renew()
        if time.monotonic() - self._published > AGAIN:      # pages show its time and counts without asking
            self._published = time.monotonic()
            self._publish_all()
        link, until = self.connection.link, None
        if link is not None:
            until = self.run.until() if self.run else link.t + TURN
        if link is None or until is None:
            self.commanding.uplink.poll()
            self._over.wait(TURN / 1e9)
            return
        arrived = self.connection.receive(until)
        if self.clock.simulated:
            self.clock.now = max(self.clock.now, link.t)
        self._advance()
        packets = self.clock.timed(arrived, link.t)
        packets = self._lost(packets)
        if self.commanding.left and (packets or not self.clock.simulated):
            self.commanding.restore()
        if packets:
            self.take(packets)
        self.telemetry.report_gaps()
        self.commanding.uplink.poll()
        self.transfers.poll()
        self.stored.poll()
        self.feed.sample()

    def _lost(self, packets: Packets) -> Packets:
        """Note what the link has lost; returns the packets that are new."""
        past, reached = (self.control.past, self.control.reached) if self.control else (-1.0, 0.0)
        for begin, end, why in self.connection.gaps():
            if end < 0:
                end = max(begin, self.clock.now, round(reached * 1e9))
            packets = self.telemetry.lost(begin, end, why, packets, past)
        return packets

    def _publish_all(self) -> None:
        if damages := self.connection.damages():
            more = f"; and {len(damages) - 1} times more" if len(damages) > 1 else ""
            self.reporter.event("warning", "link", damages[0] + more)
        self.contacts.poll()
        self.alarms.poll()
        self.reporter.flush()
        self.handle(self.telemetry.retry())
        self.telemetry.recovered()
        self.publish()
        if run := self.describe_run():
            self.reporter.publish("run", run)

    def _answer(self) -> None:
        """Carry out the requests of other threads."""
        self._advance()
        try:
            while True:
                request, answer = self._requests.get_nowait()
                if not answer.set_running_or_notify_cancel():   # its thread has given up
                    continue
                try:
                    answer.set_result(request())
                except BaseException as error:  # for the thread that requested it
                    answer.set_exception(error)
        except Empty:
            pass

    def _advance(self) -> None:
        """Go on with UTC. What waits for a time waits as long when the server's clock is set."""
        if step := self.clock.advance():
            self.commanding.uplink.stepped(step)
            self.alarms.stepped(step)
            self.reporter.event("warning", "server", f"the clock went {'back' if step < 0 else 'forward'} by "
                                f"{abs(step) / 1e9:g} s" + ": a new session begins" * (step < 0))

    def _renew(self) -> None:
        """The database is a new one."""
        self.limits.begin()
        self.alarms.anew()
        if self.modes:
            self.modes.begin(self.telemetry.monitor)
        self.commanding.load()
        self.reporter.event("info", "database", f"the database has changed and was read anew: "
                            f"{len(self.telemetry.slot_names)} parameters")
        self.telemetry.report_left_out()
        self.reporter.publish("slots", {"first": 0})

    def take(self, packets: Packets) -> None:
        """Archive and decode a batch of packets, then handle its notes."""
        self.handle(self.telemetry.decode(packets))
        self.handle(self.telemetry.derived.turn())
        if self.modes:
            self.modes.poll()
        self.telemetry.count(packets)

    def handle(self, notes: Iterable[Note]) -> None:
        """What the monitor notes of a batch, each to the part that it is for."""
        concerns: list[tuple[int, int, int, int]] = []
        for kind, *rest in notes:
            if kind == "concern":
                slot, t, old, new = rest
                concerns.append((slot, t, old, new))
            elif kind == "undecoded":
                self.telemetry.refused(*rest)
            elif kind == "watched":
                self._report(rest[3])
            elif kind == "verified":
                self.commanding.uplink.verified(*rest)
            elif kind == "slots":
                self.telemetry.extend(rest[0])
                if self.modes:
                    self.modes.learn(rest[0])
                self.handle(self.limits.in_force.learn(rest[0]))
                self.reporter.publish("slots", {"first": rest[0]})
            elif kind == "archive":
                self.telemetry.archived(rest[0])
            elif kind == "full":
                self.reporter.event("critical", "server", rest[0])
        if concerns:
            self.alarms.take(concerns)

    def _report(self, packet: bytes) -> None:
        """Take a packet of flight's own services: its contents become events."""
        craft = self.connection.craft
        if craft is None:
            return
        craft.take(packet)
        for event in craft.events:
            self.reporter.event(OF_FLIGHT.get(event.severity, event.severity), event.output, event.text, event.t)
        for text in craft.texts:
            self.reporter.event("info", text.kind.name.lower(), text.text, text.t)
        craft.events.clear()
        craft.texts.clear()

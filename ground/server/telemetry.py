# SPDX-License-Identifier: Apache-2.0
"""The telemetry of one spacecraft: its database, the monitor that decodes packets, and the archive that keeps them."""
from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from fledge.commands import SERVICES
from fledge.errors import SetupError, listed
from fledge.ground.database import Database
from fledge.ground.server.clock import Packets
from fledge.ground.server.derived import DerivedParameters
from fledge.ground.server.link import AGAIN
from fledge.records.series import stale_after

if TYPE_CHECKING:
    from fledge.commands import Dictionary
    from fledge.ground.database import History, Monitor, PacketArchive
    from fledge.ground.server.limits import Change
    from fledge.ground.server.mission import LoadedMission
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.settings import CraftSettings

Note = tuple[Any, ...]  #: of Monitor.take(): what it is, and what its kind has

REASONS = 50            # different ones of packets that are not decoded become events
RECENT = 500            # packets that are kept for a spacecraft without an archive


class Telemetry:
    """All but `slots` and `inspect` is for the spacecraft's own thread.

    mission: the one that sends the packets, or None; folder: of the files of derived parameters
    changes: of limits, as the journal has them; periods: [s] of the instances that a task of the mission runs
    publish_state: sends the spacecraft's state to browsers
    """

    def __init__(self, settings: CraftSettings, database: Database, mission: LoadedMission | None, folder: Path,
                 reporter: Reporter, changes: list[Change], periods: Mapping[str, float],
                 publish_state: Callable[[], None]) -> None:
        self._settings, self._mission, self._folder = settings, mission, folder
        self._reporter, self._clock, self._changes = reporter, reporter.clock, changes
        self._publish_state = publish_state
        self._dictionary: Dictionary | None = mission.dictionary if mission else None
        self._stale = {path: stale_after(period) for path, period in periods.items()}
        self.database = database
        self.monitor: Monitor = database.monitor(settings.root)
        self.derived = self._derive(self.monitor)
        self.archive: PacketArchive | None = None       #: None: packets are not kept
        self.history: History | None = None             #: that reads what the archive keeps
        self.reading = Lock()                           #: of the history
        self.archive_problem = ""                       #: why packets are not kept now; empty: they are
        self._archives, self._missed = Path(), 0        # missed: packets that an event has reported
        self.packets = self.undecoded = self.bytes = 0
        self.recent: deque[tuple[int, int, bytes]] = deque(maxlen=RECENT)
        self.bad: deque[tuple[int, int, bytes, str]] = deque(maxlen=RECENT)     #: not decoded, with the reason
        self.sinks: list[Callable[[Packets], None]] = []        #: get each batch after it is shown
        self._reasons: set[str] = set()
        self._last = -1     # [ns] of the newest packet; of a co-simulation also that of the session before
        self._gaps: list[tuple[str, int]] = []          # that no event has reported
        self._written: dict[Path, int] = {}     # when files were
        self._written, self._checked = self._times(), 0.0
        self.slot_names: list[str] = []
        self.slot_numbers: dict[str, int] = {}
        self._watch()

    # --- for all threads ---

    def slots(self, first: int = 0, most: int = 2**32 - 1) -> list[dict[str, Any]]:
        """The parameters, as the monitor describes them. header: of the packet, or of a message of Fledge: its head,
        its time, its padding. stale: [s] the age at which a value is; None: it is not known."""
        outputs = [output.path for output in self._dictionary.outputs] if self._dictionary else []
        folded = (*(f"{path}.{part}" for path in outputs for part in ("head.", "spare")),
                  *(f"{self._dictionary.name}.{name}.{part}" for name in SERVICES for part in ("t", "spare")
                    if self._dictionary))
        return [slot | {"header": slot["header"] or slot["name"].startswith(folded),
                        "stale": self._stale.get(".".join(slot["name"].split(".")[:2]))}
                for slot in self.monitor.slots(first, most)]

    def inspect(self, packet: bytes) -> dict[str, Any]:
        """A packet in words."""
        words = dict(self.monitor.inspect(packet))
        words["rows"] = [[value.hex() if isinstance(value, bytes) else value for value in row] for row in words["rows"]]
        return words | {"hex": packet.hex(), "size": len(packet)}

    def describe(self) -> dict[str, Any]:
        """The counts for browsers."""
        return {"packets": self.packets, "undecoded": self.undecoded, "bytes": self.bytes,
                "archive": self.archive_problem}

    # --- packets ---

    def decode(self, packets: Packets) -> list[Note]:
        """Archive and decode a batch; returns the monitor's notes."""
        self.recent.extend(packets[-RECENT:])
        notes: list[Note] = self.monitor.take(packets)
        self._clock.now = max(self._clock.now, packets[-1][0]) if self._clock.simulated else packets[-1][0]
        return notes

    def count(self, packets: Packets) -> None:
        """A batch is in the archive, and its alarms are known: count it, and give it to the sinks."""
        self.packets += len(packets)
        self.bytes += sum(len(packet) for _, _, packet in packets)
        self._last = packets[-1][0]
        for sink in list(self.sinks):       # the event loop changes it
            sink(packets)

    def refused(self, t: int, received: int, packet: bytes, reason: str) -> None:
        """A packet was not decoded."""
        self.undecoded += 1
        self.bad.append((t, received, packet, reason))
        if reason not in self._reasons and len(self._reasons) < REASONS:
            self._reasons.add(reason)
            self._reporter.event("warning", "server", f"a packet of {len(packet)} bytes was not decoded: {reason}", t)

    def extend(self, first: int) -> None:
        """The monitor has new slots, from one on."""
        more = self.monitor.slots(first)
        self.slot_numbers |= {slot["name"]: slot["slot"] for slot in more}
        self.slot_names += [slot["name"] for slot in more]

    # --- what is missing ---

    def lost(self, begin: int, end: int, why: str, packets: Packets, repeated: float) -> Packets:
        """Note that packets of a co-simulation are missing, from -1: those before the server was there. repeated: [s]
        until which the run repeats an earlier one. Returns those that came, without what the archive has already."""
        assert self.archive is not None and self.history is not None
        follows = not self.packets and 0 <= self._last      # a session that began before: the archive knows the gap
        if begin < 0:
            if end <= repeated * 1e9:
                return packets
            begin = max(self._last, 0)
            if end <= begin:    # the run's last message comes again
                with self.reading:
                    known = {(t, packet) for t, _, _, packet in self.history.packets(packets[0][0], begin)} \
                        if packets else ()
                return [packet for packet in packets if (packet[0], packet[2]) not in known]
        if not follows:
            self.archive.missing(begin, end, why)
        self._clock.gaps.append((begin, end))
        self._gaps.append((f"telemetry is missing from {begin / 1e9:g} s to {end / 1e9:g} s: {why}", end))
        return packets

    def report_gaps(self) -> None:
        """An event of each gap, once the archive has it."""
        while self._gaps:
            text, end = self._gaps.pop(0)
            self._reporter.event("warning", "link", text, end)

    # --- the archive ---

    def keep(self, folder: Path) -> None:
        """Archive what comes. Raises SetupError if another program does."""
        self._archives, self._missed, name = folder, 0, self._settings.name
        self.archive = self.database.archive(folder, name)
        self.monitor.sink(self.archive)
        self.history = self.database.history(folder, name, self._settings.root)
        if self._settings.link.startswith("cosim:") and not self.packets and (before := self.history.sessions()):
            self._last = before[-1]["last"]

    def archived(self, problem: str) -> None:
        """Packets are not kept from now on, or (empty) they are again."""
        missing = self.archive.lost - self._missed if self.archive is not None else 0
        if not problem:
            self._missed += missing
        self.archive_problem = problem
        self._reporter.event("critical" if problem or missing else "info", "archive", problem or
                             f"the archive is written again: {missing or 'no'} packets are missing")
        self._publish_state()

    def retry(self) -> list[Note]:
        """Write what the archive does not have yet, also while no packet comes."""
        return self.monitor.take([]) if self.archive_problem or self._gaps else []

    def recovered(self) -> None:
        """Note that the archive takes packets again, if it does."""
        if self.archive_problem and self.archive is not None and not self.archive.problem:
            self.archived("")

    def close(self) -> None:
        self.monitor.sink(None)
        if self.archive is not None:
            try:
                self.archive.close()
            except SetupError as error:
                self.archived(str(error))
            self.archive = None

    # --- the database ---

    def reload(self) -> bool:
        """Load a database that has changed on disk; returns whether there is a new one. A wrong one is refused, and
        the old one stays. The files of a mission cannot be read again while it flies."""
        if time.monotonic() - self._checked < AGAIN or self.archive_problem:    # which still has to take packets
            return False
        self._checked, before, self._written = time.monotonic(), self._written, self._times()
        if self._written == before:
            return False
        if self._settings.mission:
            names = sorted({path.name for path, _ in before.items() ^ self._written.items()})
            self._reporter.event("warning", "database", f"the mission has changed ({listed(names)}); the server has "
                                 "the old one until it starts again")
            return False
        try:
            database = Database.load(*self._settings.database, lenient=self._settings.lenient)
            monitor = database.monitor(self._settings.root)
            derived = self._derive(monitor)
        except (SetupError, OSError) as error:
            self._reporter.event("critical", "database",
                                 f"the changed database is refused, the old one stays: {error}")
            return False
        with self.reading:
            self.monitor.sink(None)
            try:
                if self.archive is not None:
                    self.archive.close()
            except SetupError as error:
                self.monitor.sink(self.archive)
                self._written = before
                self.archived(str(error))
                return False
            self.database, self.monitor, self.derived = database, monitor, derived
            self.keep(self._archives)
        self._watch()
        return True

    def report_left_out(self) -> None:
        """An event of what a lenient database has left out."""
        if left := self.database.left_out:
            self._reporter.event("warning", "database", f"{len(left)} things of the database are left out: "
                                 f"{'; '.join(left[:3])}{'; ...' * (len(left) > 3)}")

    def _derive(self, monitor: Monitor) -> DerivedParameters:
        return DerivedParameters(self._settings.derived, self._folder, monitor, self._changes, self._reporter)

    def _times(self) -> dict[Path, int]:
        """When the files of the database, or of the mission, and of derived parameters were written."""
        files = [*self._settings.database, *(self._folder / parameter.function.rpartition(":")[0]
                                             for parameter in self._settings.derived if parameter.function)]
        if self._mission:
            files += self._mission.files
            files += self._mission.folder.glob("ground.toml") if self._mission.folder else []
        try:
            return {file: file.stat().st_mtime_ns for file in files}
        except OSError:
            return self._written        # it is being written

    def _watch(self) -> None:
        """Let the monitor note each packet that flight's own services need."""
        self.slot_names = [slot["name"] for slot in self.monitor.slots(0)]
        self.slot_numbers = {name: i for i, name in enumerate(self.slot_names)}
        if self._dictionary is None:
            return
        process = self._dictionary.name
        names = self.database.container_names()
        wanted = {f"{process}.{name}" for name in ("reports", "texts", *SERVICES)}
        outputs = {output.path for output in self._dictionary.outputs}
        events = {f"{output.path}.{event.name}" for output in self._dictionary.outputs for event in output.events}
        self.monitor.watch([path for path, name in names.items() if name in wanted - outputs or name in events])

# SPDX-License-Identifier: Apache-2.0
"""Sends commands and follows their stages, in two ways with the same interface.

A mission of Fledge numbers its commands and reports them by its own protocol (FlightUplink). A spacecraft that has only
a database gets numbers of the server, and its telemetry fulfils the verifiers of the database (DatabaseUplink).
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from fledge.commands import STORED, Code, Stage, checksummed, numbered, sequence_of
from fledge.errors import SetupError
from fledge.ground.scripts.craft import Sent
from fledge.ground.scripts.framed import Framed
from fledge.ground.server.stages import DELIVERED, GIVEN_UP
from fledge.ground.server.verifying import Verifying

if TYPE_CHECKING:
    from fledge.commands import Dictionary
    from fledge.ground.database import Form
    from fledge.ground.server.link import Connection
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.settings import CraftSettings
    from fledge.ground.server.stages import Command, Stages
    from fledge.ground.server.telemetry import Telemetry

WITHIN = 60_000_000_000     # [ns] of the spacecraft's clock until a command without a report counts as failed
WORDS = {Stage.ACCEPTED: "accepted", Stage.STARTED: "started", Stage.UNDER_WAY: "progress", Stage.DONE: "completed"}


def finished(packet: bytes, number: int, header: str) -> bytes:
    """The packet with sequence and length, and with a checksum for cfs. header: none, ccsds, cfs. Raises
    SetupError if it has no room for a checksum."""
    if header == "none" or header == "ccsds" and len(packet) < 7:
        return packet
    if header == "cfs" and len(packet) < 8:
        raise SetupError(f"a command of cFS has 8 bytes at least, the last of them its checksum; this one has "
                         f"{len(packet)}: header = \"ccsds\" is without")
    packet = numbered(packet, number)
    return checksummed(packet) if header == "cfs" else packet


class Uplink(ABC):
    """For the spacecraft's own thread."""

    header: str     #: of its commands: none, ccsds, cfs

    @abstractmethod
    def prepare(self, form: Form) -> None:
        """Complete a form of the database."""

    def reload(self) -> None:
        """Go on with a new database; its forms are prepared."""

    @abstractmethod
    def numbered(self, packet: bytes) -> bytes:
        """With the sequence that is next. Raises SetupError."""

    @abstractmethod
    def follows(self, form: Form | None) -> bool:
        """Whether stages of a command are known after its release. form: None: it has none."""

    @abstractmethod
    def send(self, row: Command, packets: list[bytes], form: Form | None, then: Callable[[Sent], None] | None) -> None:
        """Send the packets of a command that the journal has. then: is called when it is executed. Raises OSError."""

    @abstractmethod
    def restore(self, row: Command, packets: list[bytes], form: Form | None) -> bool:
        """Go on with a command of the last server, if its stages can be known."""

    @abstractmethod
    def poll(self) -> None:
        """Add the stages that commands have reached since the last call."""

    def verified(self, number: int, t: int, returned: str) -> None:
        """A packet fulfils a verifier, by the monitor."""

    @abstractmethod
    def stepped(self, by: int) -> None:
        """The server's clock was set [ns]."""

    def commands_in(self, packet: bytes) -> Iterator[str]:
        """The commands in a packet that the server did not make, as a script's: their paths, or their names as in
        forms; one that writes a part of an array, NAME.from_NUMBER, has the name of the whole."""
        yield from ()


class FlightUplink(Uplink):
    """By flight's own protocol: its link has a Craft, which numbers commands and gets their reports."""

    header = "cfs"

    def __init__(self, settings: CraftSettings, dictionary: Dictionary, connection: Connection, telemetry: Telemetry,
                 stages: Stages) -> None:
        self._settings, self._dictionary, self._connection, self._clock = settings, dictionary, connection, stages.clock
        self._telemetry, self._stages = telemetry, stages
        self._open: list[tuple[Command, Sent, int]] = []            # and how many reports of it the row has
        self._then: dict[int, Callable[[Sent], None]] = {}      # by the row's id
        self._stepped: dict[int, int] = {}      # [ns] by the row's id, by which the clock was set since its release

    def prepare(self, form: Form) -> None:
        form["verifiers"] = []                  # flight's own reports have more

    def numbered(self, packet: bytes) -> bytes:
        craft = self._connection.craft          # None: before the link was opened, so that nothing can be sent
        return craft.numbered(packet) if craft else packet

    def follows(self, form: Form | None) -> bool:
        return True

    def send(self, row: Command, packets: list[bytes], form: Form | None, then: Callable[[Sent], None] | None) -> None:
        craft = self._connection.craft
        assert craft is not None
        self._open.append((row, craft.send(packets), 0))
        if then:
            self._then[row["id"]] = then

    def restore(self, row: Command, packets: list[bytes], form: Form | None) -> bool:
        craft = self._connection.craft
        assert craft is not None
        sent = Sent(craft, packets)
        craft.sent.insert(0, sent)
        self._open.append((row, sent, 0))
        return True

    def poll(self) -> None:
        if not self._open:
            return
        left = []
        for row, sent, seen in self._open:
            n = len(row["stages"])
            over = self._advance(row, sent, seen)
            if over:
                self._stepped.pop(row["id"], None)
                self._stages.end(row)
            elif len(row["stages"]) != n:
                self._stages.keep(row)
            if not over:
                left.append((row, sent, len(sent.reports)))
            elif (then := self._then.pop(row["id"], None)) and row["stages"][-1]["stage"] == "completed":
                then(sent)
        self._open = left
        if (craft := self._connection.craft) and not left:
            del craft.sent[:-1]     # a late report would match none; the last one has flight's sequence

    def _advance(self, row: Command, sent: Sent, seen: int) -> bool:
        """Add the stages that are new; returns whether it is over."""
        stages = {stage["stage"] for stage in row["stages"]}
        if "delivered" not in stages and sent.arrived and len(sent.arrived) == len(sent.packets):
            self._stages.add(row, "delivered", True, DELIVERED)
        if sent.given_up and not sent.reports and "failed" not in stages:
            self._stages.add(row, "failed", False, GIVEN_UP)
            return True
        if len(sent.reports) < seen:        # flight counts otherwise, and all was sent again
            row["hex"] = " ".join(packet.hex() for packet in sent.packets)
            seen = 0
        for report in sent.reports[seen:]:
            if not report.good:
                packet = next((packet for packet in sent.packets if sequence_of(packet) == report.sequence), None)
                self._stages.add(row, "failed", False, self._dictionary.refusal(report, packet))
                return True
            word = WORDS.get(report.stage, "progress")
            same = {other.sequence for other in sent.reports if other.stage == report.stage and other.good}
            if word != "progress" and (word in stages or len(same) < len(sent.packets)):
                continue
            stages.add(word)
            at = f"at {report.t / 1e9:g} s" if report.stage != Stage.ACCEPTED else ""
            self._stages.add(row, word, True, f"{report.detail} %" if word == "progress" else at)
            if word == "progress":
                row["stages"][-1]["percent"] = report.detail
            if word == "completed":
                row["data"] = sent.data.hex()
                return True
        within = WITHIN + round(2e9 * self._settings.light_time)
        age = self._clock.now - int(row["t_ns"]) - self._stepped.get(row["id"], 0)
        if age > within and not any(stage["stage"] in (
                "started", "progress", "unknown", "failed") for stage in row["stages"]):
            self._stages.add_overdue(row, "completed", f"no report of its execution within {within / 1e9:g} s",
                                     int(row["t_ns"]))
        return age > 60 * within

    def stepped(self, by: int) -> None:
        for row, _, _ in self._open:
            self._stepped[row["id"]] = self._stepped.get(row["id"], 0) + by

    def commands_in(self, packet: bytes) -> Iterator[str]:
        """With those that it stores, stages, commits, or loads from a table on board."""
        database = self._telemetry.database
        while True:
            packet = numbered(packet, 0)    # as it will be sent
            if command := database.decode_command(packet, self.header).command:
                yield command
            for path in self._dictionary.written(packet):
                process, _, name = path.partition(".")
                yield f"{process}.write.{name}"
            if packet[6] != Code.STORE or len(packet) <= STORED + 6:
                return
            packet = packet[STORED:]


class DatabaseUplink(Uplink):
    """By a database: the server numbers the commands, and packets of telemetry fulfil the verifiers."""

    def __init__(self, settings: CraftSettings, connection: Connection, telemetry: Telemetry,
                 reporter: Reporter, stages: Stages) -> None:
        self.header = settings.header
        self._connection, self._telemetry, self._clock = connection, telemetry, stages.clock
        self._reporter, self._stages = reporter, stages
        self._verifying = Verifying(stages, telemetry)
        self._sequences: dict[int, int] = {}        # of each stream, the newest one
        self._going: dict[bytes, Command] = {}          # packets that the link will confirm

    def prepare(self, form: Form) -> None:
        self._verifying.prepare(form)

    def reload(self) -> None:
        self._verifying.end("the database has changed: the verifiers of this command are not known any more")

    def numbered(self, packet: bytes) -> bytes:
        stream = int.from_bytes(packet[:2], "big") & 0x7FF
        if stream not in self._sequences:       # on from that of the last server
            sent = [earlier for row in self._reporter.newest("sent")
                    for earlier in reversed(list(map(bytes.fromhex, row["hex"].split())))]
            self._sequences[stream] = next((sequence_of(earlier) for earlier in sent
                                            if int.from_bytes(earlier[:2], "big") & 0x7FF == stream), -1)
        number = self._sequences[stream] = self._sequences[stream] + 1
        return finished(packet, number, self.header)

    def follows(self, form: Form | None) -> bool:
        return bool(form and form["verifiers"])

    def send(self, row: Command, packets: list[bytes], form: Form | None, then: Callable[[Sent], None] | None) -> None:
        link = self._connection.link
        assert link is not None
        for packet in packets:
            link.send(packet)
            if isinstance(link, Framed) and link.frames.cop1:
                self._going[packet] = row
        if form:
            self._verifying.begin(row, form, packets[0])

    def restore(self, row: Command, packets: list[bytes], form: Form | None) -> bool:
        if form:
            self._verifying.begin(row, form, packets[0])
            self._stages.keep(row)
        return bool(form)

    def poll(self) -> None:
        self._verifying.poll(self._clock.now)
        for packet, good in self._connection.link.answers() if self._connection.link else ():
            if row := self._going.pop(packet, None):
                self._stages.add_delivered(row, good)
                self._stages.keep(row)

    def verified(self, number: int, t: int, returned: str) -> None:
        self._verifying.take(number, t, returned)

    def stepped(self, by: int) -> None:
        self._verifying.stepped(by)

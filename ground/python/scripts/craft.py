# SPDX-License-Identifier: Apache-2.0
"""A spacecraft as a script of the ground sees it: commands with their verification, and the newest telemetry."""
from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from inspect import signature
from typing import TYPE_CHECKING, Any

from fledge.commands import (SERVICES, Code, Dictionary, Event, Packets, Reason, Report, Selected, Stage, Telemetry,
                             Text, Timed, decoded, moved, sequence_of)
from fledge.errors import SetupError, did_you_mean, listed
from fledge.ground.scripts.links import Link, NoAnswer
from fledge.objects.si import time_ns, to_si
from fledge.units import unit_of

if TYPE_CHECKING:
    from typing import Self

    from fledge.ground.scripts.files import Files, Transfer

_MAKERS = {"numbered", "packet", "pdu", "write_bytes", "change"}    # of packets, but no commands of their own
EVENTS = 10_000                                  # of which repetitions are recognized
SHOWN = 8                                       # names of outputs in an error
WITHIN = 10.0                                   # [s] that a script waits, by default


class NotSeen(LookupError):
    """No packet of telemetry has this value yet."""


class Newest:
    """The newest telemetry of a spacecraft: `mode`, and each output's fields by their path, as in
    t.flight.control.torque.u or t["flight.control.torque"]. t.flight.mode and t.flight.housekeeping.mode are the mode's
    name, too. A value that no packet had yet raises NotSeen; in the condition of wait() it counts as not fulfilled."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._outputs = [output.path for output in dictionary.outputs]
        paths = self._outputs + [block.path for block in dictionary.blocks]
        processes = dict.fromkeys(path.partition(".")[0] for path in paths)
        self._states = [f"{process}.housekeeping" for process in processes]
        self._beginnings = {path[:i] for path in self._outputs for i, letter in enumerate(path) if letter == "."}
        self._contents: dict[str, Any] = {}
        self.events: list[Event] = []   #: of modules, in the order of their arrival; each once

    def put(self, packet: Telemetry) -> None:
        """Take a packet that has come."""
        self._contents[packet.path] = packet.content
        if isinstance(packet.content, Selected):
            self._contents[f"selected {packet.content.report}"] = packet.content

    @property
    def housekeeping(self) -> dict[str, Any]:
        """The counters of commands, the time and the number of the mode, by name. Raises NotSeen."""
        return dict(self._content("housekeeping"))

    @property
    def mode(self) -> str:
        """The name of the mode in force, of housekeeping. Raises NotSeen, and SetupError where flight has no modes."""
        if not self._dictionary.modes:
            raise SetupError(f"{self._dictionary.name} has no modes")
        return self._dictionary.modes[self.housekeeping["mode"]]

    def selected(self, place: int) -> dict[str, Any]:
        """The numbers of a report of housekeeping by their paths. Raises NotSeen, and SetupError if what it
        has is not known."""
        report: Selected = self._content(f"selected {place}")
        if report.values is None:
            raise SetupError(f"another ground has defined the report {place} of {self._dictionary.name}: let "
                             "dictionary.learn() have what flight reads back of it")
        return dict(report.values)

    def __getitem__(self, path: str) -> Any:
        """An output's fields as a dict, or one field."""
        if path.endswith(".mode") and f"{path.removesuffix('mode')}housekeeping" in self._states:
            return self.mode
        known = [*self._outputs, *self._states]
        output = next((start for start in known if path == start or path.startswith(f"{start}.")), None)
        if output is None:
            raise SetupError(f"{self._dictionary.name} has no output '{path}'{did_you_mean(path, known)} "
                             f"it has {listed(known, SHOWN)}")
        value = self._content(output) if output in self._outputs else self.housekeeping | (
            {"mode": self.mode} if self._dictionary.modes else {})
        for name in path[len(output) + 1:].split(".") if path != output else []:
            if not isinstance(value, dict) or name not in value:
                known = list(value) if isinstance(value, dict) else []
                raise SetupError(f"{path}: there is no field '{name}'{did_you_mean(name, known)} it has "
                                 + listed(known))
            value = value[name]
        return value

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return _Path(self, name)

    def _content(self, path: str) -> Any:
        if path not in self._contents:
            raise NotSeen(path)
        return self._contents[path]


class _Path:
    """The beginning of an output's path, which attributes continue."""

    def __init__(self, newest: Newest, path: str) -> None:
        self._newest, self._path = newest, path

    def __getattr__(self, name: str) -> Any:
        path = f"{self._path}.{name}"
        if path in self._newest._beginnings:
            return _Path(self._newest, path)
        value = self._newest[path]
        return _Fields(value) if isinstance(value, dict) else value


class _Fields(dict[str, Any]):
    """The fields of a message, as attributes too."""

    def __getattr__(self, name: str) -> Any:
        if name not in self:
            known = list(self)
            raise AttributeError(f"there is no field '{name}'{did_you_mean(name, known)} it has {listed(known)}")
        return _Fields(self[name]) if isinstance(self[name], dict) else self[name]


class Sent:
    """A command on its way: one packet, or several that together are one change."""

    def __init__(self, craft: Craft, packets: Sequence[bytes]) -> None:
        self._craft = craft
        self.packets = list(packets)            #: in the order in which flight gets them
        self.reports: list[Report] = []         #: of flight about them
        self.at = craft.link.t                  #: [ns] of the link's clock
        self.arrived: list[bytes] = []          #: packets of which the link knows that the spacecraft has them
        self.given_up = False                   #: the link has given one up: it may have arrived or not

    @property
    def data(self) -> bytes:
        """What a command read back, big-endian."""
        return b"".join(report.data for report in self.reports if report.executed)

    @property
    def progress(self) -> int:
        """[%] of what a command began, as flight has reported it last."""
        return max((100 if report.executed and report.good else report.detail if report.stage == Stage.UNDER_WAY else 0
                    for report in self.reports), default=0)

    @property
    def over(self) -> bool:
        """Whether flight will report no more of it: it is done, or refused."""
        executed = sum(report.executed for report in self.reports)
        return executed == len(self.packets) or not all(report.good for report in self.reports)

    def delivered(self, within: Any = WITHIN) -> Self:
        """Wait until the link knows that the spacecraft has all of it: by frames with COP-1. Raises NoAnswer."""
        self._craft.wait(lambda _: self._is_on_its_way() and len(self.arrived) == len(self.packets), within,
                         lambda: f"{self!r} was not confirmed by the link")
        return self

    def accepted(self, within: Any = WITHIN) -> Self:
        """Wait until flight has accepted all of it. Raises NoAnswer, also if flight refuses it."""
        return self._reported("accepted", {Stage.ACCEPTED}, within)

    def started(self, within: Any = WITHIN) -> Self:
        """Wait until flight has begun all of it, which may go on. Raises NoAnswer, also if flight refuses it."""
        return self._reported("started", {Stage.STARTED, Stage.DONE}, within)

    def completed(self, within: Any = WITHIN) -> Self:
        """Wait until flight has executed all of it. Raises NoAnswer, also if flight refuses it."""
        return self._reported("executed", {Stage.DONE}, within)

    def __repr__(self) -> str:
        words = ", ".join(dict.fromkeys(map(self._craft.dictionary.command, self.packets)))
        done = sum(report.executed and report.good for report in self.reports)
        refused = next((report for report in self.reports if not report.good), None)
        return f"<{words}: " + ("refused" if refused else "executed" if done == len(self.packets) else
                                self.reports[-1].stage_text if self.reports else "sent") + ">"

    def take(self, report: Report) -> bool:
        """Whether a report is about one of these packets, and new."""
        if not any(sequence_of(packet) == report.sequence and packet[6] == report.code
                   for packet in self.packets) or any(
                known[1:6] == report[1:6] for known in self.reports):
            return False
        self.reports.append(report)
        return True

    def answered(self, packet: bytes, good: bool) -> bool:
        """What the link has learned of a packet, if it is one of these."""
        if packet not in self.packets or packet in self.arrived:
            return False
        self.arrived += [packet] * good
        self.given_up |= not good
        return True

    def _is_on_its_way(self) -> bool:
        """Raises NoAnswer if it is not."""
        if self.given_up and not self.reports:
            raise NoAnswer(f"the link gave {self!r} up after its last transmission; it may have arrived or not")
        return True

    def moved(self, by: int) -> None:
        """Count on from another sequence, since flight has refused this one."""
        self.packets = [moved(packet, by) for packet in self.packets]
        self.reports.clear()
        self.arrived.clear()
        self.given_up = False

    def _reported(self, word: str, stages: set[Stage], within: Any) -> Self:
        def done(_: Newest) -> bool:
            self._is_on_its_way()
            for report in self.reports:
                if not report.good:
                    packet = next(p for p in self.packets if sequence_of(p) == report.sequence)
                    raise NoAnswer(f"{self._craft.dictionary.name} refused "
                                   + self._craft.dictionary.refusal(report, packet))
            return len({report.sequence for report in self.reports if report.stage in stages}) == len(self.packets)

        self._craft.wait(done, within, lambda: f"{self!r} was not reported as {word}")
        return self


class Craft:
    """A spacecraft behind a link.

    Reading waits on the link's clock: simulated time in a simulation, which then goes on by as much, else real time.
    A command by a link from the ground has the number after the last command that flight accepted from any sender.
    """

    def __init__(self, link: Link, dictionary: Dictionary, sequence: int = 0) -> None:
        self.link, self.dictionary = link, dictionary
        self.telemetry = Newest(dictionary)         #: the newest of each packet
        self.texts: list[Text] = []                 #: of interpreters on board
        self.events = self.telemetry.events         #: of modules on board, each once
        self.refused = 0                            #: packets that the dictionary does not know
        self.missed = 0                             #: packets that were lost on the way, by their sequences
        self.sent: list[Sent] = []
        self._packets = Packets(dictionary, sequence)
        self._sequences: dict[int, int] = {}        # the last of each stream
        self._event_keys: dict[tuple[int, int, str], None] = {}  # number, time and output of the newest events
        self.in_step = link.numbers     #: flight has accepted a command from here
        self._files: Files | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: Any) -> None:
        if self._files:
            self._files.close()
        self.link.close()

    def command(self, name: str, /, *arguments: Any, confirmed: bool = False, unchecked: bool = False,
                **values: Any) -> Sent:
        """Send a command, one that fledge.commands.Packets makes: command("mode", "science"), command("noop"),
        command("write", "flight.control", K=3 * N * m), command("telemetry", "housekeeping", every=2). confirmed: it is
        meant, which a server of a control room asks for hazardous ones; unchecked: the server does not check its
        constraints, where they may be suspended. Raises SetupError for what the mission does not have."""
        packets = self.packets(name, *arguments, **values)
        self.link.confirmed, self.link.unchecked = confirmed, unchecked
        try:
            return self.send(packets)
        finally:
            self.link.confirmed = self.link.unchecked = False

    def packets(self, name: str, /, *arguments: Any, **values: Any) -> list[bytes]:
        """The packets of such a command, for send(). Raises SetupError for what the mission does not have."""
        return packets(self._packets, name, *arguments, **values)

    def numbered(self, packet: bytes) -> bytes:
        """A command that was made elsewhere, with the sequence that is next here, its length and its checksum."""
        return self._packets.numbered(packet)

    def send(self, packets: Sequence[bytes]) -> Sent:
        """Send packets as they are, one change. Raises OSError if the link is broken."""
        sent = Sent(self, packets)
        self.sent.append(sent)
        self._before_send(sent)
        for place, packet in enumerate(sent.packets):
            sent.packets[place] = self.link.send(packet) or packet
        return sent

    def _before_send(self, sent: Sent) -> None:
        """A command is about to be sent."""

    # --- files ---

    @property
    def files(self) -> Files:
        """How files go, by CFDP: fledge.ground.scripts.files.Files(craft, rate=9600) sets what is not as usual."""
        if self._files is None:
            from fledge.ground.scripts.files import Files       # a script without files does not need its extension

            self._files = Files(self)
        return self._files

    @files.setter
    def files(self, files: Files) -> None:
        if self._files:
            self._files.close()
        self._files = files

    @property
    def has_files(self) -> bool:
        """Whether `files` was used or set."""
        return self._files is not None

    def put(self, local: str | os.PathLike[str], to: str | None = None, *, within: Any = None, class1: bool = False,
            progress: Callable[[Transfer], Any] | None = None) -> Transfer:
        """Send a file. to: its name on board; None: the same. within: wait until it is there; None: go on, and send
        while the script waits for anything. class1: without acknowledgements. progress: is called as it goes.
        Raises SetupError, and NoAnswer if it does not arrive."""
        transfer = self.files.put(local, to, class1, progress)
        return transfer if within is None else transfer.completed(within)

    def fetch(self, name: str, to: str | os.PathLike[str] | None = None, *, within: Any = None, class1: bool = False,
              progress: Callable[[Transfer], Any] | None = None) -> Transfer:
        """Ask for a file on board. to: where it shall be, whole; None: under its name here. The others: as of put().
        Raises SetupError, and NoAnswer if it does not come."""
        transfer = self.files.fetch(name, to, class1, progress)
        return transfer if within is None else transfer.completed(within)

    def directory(self, name: str = "", within: Any = 6 * WITHIN) -> list[str]:
        """The names in a directory on board; those of directories end with /. within: a duration on the
        link's clock. Raises NoAnswer."""
        return self.files.directory(name, within)

    # --- time ---

    def wait(self, condition: Callable[[Newest], Any], within: Any, otherwise: Callable[[], str] | None = None
             ) -> Newest:
        """Wait until a condition on the newest telemetry is true; it is evaluated after each packet. within: a
        duration on the link's clock. otherwise: the text of the error. Returns the telemetry. Raises NoAnswer."""
        begin = self.link.t
        end = begin + time_ns(within, "within")
        absent = self._holds(condition)
        while absent is not None and self.link.t < end:
            try:
                arrived = deque(self.receive(end))
            except ConnectionError as error:
                raise NoAnswer(f"{self._missing(absent, otherwise, '')}: {error}") from None
            try:
                absent = self._holds(condition)     # a file may have ended, or a packet arrived
                while arrived and absent is not None:
                    self.take(arrived.popleft().packet)
                    absent = self._holds(condition)
            finally:
                for unit in arrived:
                    self.take(unit.packet)
        if absent is not None:
            raise NoAnswer(self._missing(absent, otherwise, f" within {(end - begin) / 1e9:g} s"))
        return self.telemetry

    def listen(self, duration: Any) -> Newest:
        """Take what comes for a duration on the link's clock. Returns the newest telemetry."""
        end = self.link.t + time_ns(duration, "listen")
        while self.link.t < end:
            for _, packet in self.receive(end):
                self.take(packet)
        return self.telemetry

    def receive(self, until: int) -> list[Timed]:
        """The link's `receive`, for callers that decode the packets themselves. File transfers go on meanwhile, so it
        may return [] earlier than `until`; and commands learn from the link what has arrived."""
        packets = self.link.receive(min(until, self._files.work()) if self._files else until)
        self._poll_link()
        return packets

    def take(self, packet: bytes) -> Telemetry | None:
        """Take a packet that has come; returns its telemetry. None: the dictionary does not know it, and it is
        counted."""
        try:
            telemetry = decoded(self.dictionary, packet)
        except SetupError:
            self.refused += 1
            return None
        stream = int.from_bytes(packet[:2], "big")
        gap = (telemetry.sequence - self._sequences.get(stream, telemetry.sequence - 1) - 1) % 0x4000
        if gap < 0x2000:        # else it was overtaken, or comes again
            self.missed += gap
            self._sequences[stream] = telemetry.sequence
            self.telemetry.put(telemetry)
        if isinstance(telemetry.content, Report):
            self._report(telemetry.content)
        elif isinstance(telemetry.content, Text):
            self.texts.append(telemetry.content)
        elif telemetry.path == "files":
            self.files.take(telemetry.content)
        elif isinstance(telemetry.content, Event):
            key = (telemetry.content.number, telemetry.content.t, telemetry.content.output)
            if key not in self._event_keys:
                self._event_keys[key] = None
                if len(self._event_keys) > EVENTS:
                    del self._event_keys[next(iter(self._event_keys))]
                self.events.append(telemetry.content)
        return telemetry

    def _poll_link(self) -> None:
        """What the link has learned of packets."""
        for packet, good in self.link.answers():
            next((sent for sent in reversed(self.sent) if sent.answered(packet, good)), None)

    def _report(self, report: Report) -> None:
        if report.own:
            return
        if report.reason == Reason.SEQUENCE and not self.in_step and report.stage == Stage.ACCEPTED:
            behind = [sent for sent in self.sent if any(sequence_of(p) == report.sequence for p in sent.packets)]
            if behind and report.code in Code._value2member_map_:
                self._count_on(report.detail + 1)
            return
        if report.code == Code.PDU:
            if report.reason == Reason.ABSENT and self._files:
                self._files.absent()
            return
        ours = next((sent for sent in reversed(self.sent) if sent.take(report)), None)
        self.in_step = self.in_step or (report.good and ours is not None)      # other grounds' reports come here, too

    def _count_on(self, sequence: int) -> None:
        """Flight has accepted commands of another ground: send all again, behind those, and behind what it may have
        accepted of these."""
        self.in_step = True
        if (self._packets.sequence - sequence) % 0x4000 < 0x2000:
            sequence = self._packets.sequence
        by = sequence - sequence_of(self.sent[0].packets[0])
        self._packets.sequence += by
        for sent in self.sent:
            sent.moved(by)
            for packet in sent.packets:
                self.link.send(packet)

    def _holds(self, condition: Callable[[Newest], Any]) -> str | None:
        """None if a condition is true; else what is missing for it, "" if nothing is."""
        try:
            return None if condition(self.telemetry) else ""
        except NotSeen as missing:
            return str(missing)

    def _missing(self, absent: str, otherwise: Callable[[], str] | None, within: str) -> str:
        """Why wait() ends in vain."""
        if otherwise:
            return otherwise() + within
        if absent:
            return f"no packet of {absent} came{within}" + (
                "" if absent == "reports" or absent.startswith("selected") else
                f"; command(\"telemetry\", \"{absent}\") turns it on")
        return f"the condition was not fulfilled{within}"


def packets(maker: Packets, command: str, /, *arguments: Any, **values: Any) -> list[bytes]:
    """The packets of a command by its name and arguments. Raises SetupError."""
    known = [name for name in vars(Packets) if not name.startswith("_") and name not in _MAKERS]
    if command not in known:
        raise SetupError(f"there is no command '{command}'{did_you_mean(command, known)} there are {listed(known)}")
    make = getattr(maker, command)
    try:
        bound = signature(make).bind(*arguments, **values)
    except TypeError as error:
        raise SetupError(f"{command} takes {', '.join(signature(make).parameters) or 'nothing'}: {error}") from None
    if command == "write":
        _, block = maker.dictionary.block(bound.arguments["module"])
        units = {f.name: f.unit for f in block.fields}
        values = {name: _plain(value, f"{block.path}.{name}", units.get(name, "-")) for name, value in values.items()}
    result = make(*arguments, **values)
    if not result:
        raise SetupError(f"{command}: give parameters and their values, as in K=3")
    return [result] if isinstance(result, bytes) else list(result)


def _plain(value: Any, path: str, unit: str) -> Any:
    """A value with a unit as a number in that of its header; texts, dicts and lists of these as they are."""
    if isinstance(value, (str, dict)) or isinstance(value, list) and value and isinstance(value[0], dict):
        return value
    return to_si(value, path, unit, () if unit == "SI" else unit_of(unit).dims, f"numbers in {unit}")


def accepts(dictionary: Dictionary) -> Callable[[bytes], bool]:
    """Whether a packet of telemetry of a mission may begin with a header: what a stream is searched for."""
    first, last = dictionary.telemetry, dictionary.texts + len(SERVICES)
    longest = dictionary.longest

    def check(header: bytes) -> bool:
        return first <= int.from_bytes(header[:2], "big") <= last and int.from_bytes(header[4:6], "big") + 7 <= longest

    return check

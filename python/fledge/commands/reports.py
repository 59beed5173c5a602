# SPDX-License-Identifier: Apache-2.0
"""Packets of telemetry: reports of commands, texts, events, housekeeping and the outputs of flight."""
from __future__ import annotations

import math
import struct as packing
from collections.abc import Iterable
from typing import Any, NamedTuple

from fledge.commands.dictionary import Dictionary, EventId
from fledge.commands.fields import value_of, values
from fledge.commands.protocol import (CHOICES, EVENT_RECORD, HOUSEKEEPING, HOUSEKEEPING_RECORD, LAYOUTS, OF_LIST,
                                      OF_MONITOR, OF_RULE, OUTPUTS, REPORT_RECORD, REPORTS, RULES, SERVICES, STORED,
                                      TEXT_RECORD, Code, Kind, Reason, Stage, layout)
from fledge.elements import ELEMENTS
from fledge.errors import SetupError
from introspect.comment import SEVERITIES

STATE, REPORT, TEXT, EVENT = map(layout, (HOUSEKEEPING_RECORD, REPORT_RECORD, TEXT_RECORD, EVENT_RECORD))
SELECTED = ">q4H"                   # in front of a report's numbers
DATA = packing.calcsize("=" + REPORT)       # [bytes] in front of what a report has read back, and of a text
STORE_SIZE = packing.calcsize(LAYOUTS[Code.STORE])


class Report(NamedTuple):
    """What was done with a command: a CommandReport."""
    t: int                      # [ns] of its execution; of its acceptance: the last instant before, -1: none
    sequence: int
    code: int
    stage: Stage
    reason: Reason
    detail: int                 # of a rule: its place in the list; of a sequence: the last accepted; of a file: its
    #                             transaction at the start, then [%], CFDP's condition if it failed
    data: bytes                 # read back, big-endian
    stored_on: int | None = None    # the list of a stored command
    monitor: int | None = None      # which has started a list
    rule: int | None = None         # of the fault protection, which has started a list or requested a mode

    @property
    def good(self) -> bool:
        return self.reason == Reason.OK

    @property
    def own(self) -> bool:
        """Whether a list, a monitor or a rule on board gave the command."""
        return (self.stored_on, self.monitor, self.rule) != (None, None, None)

    @property
    def executed(self) -> bool:
        """Whether it is over: done, or refused at its execution."""
        return self.stage == Stage.DONE

    @property
    def stage_text(self) -> str:
        """The stage of a command that was not refused, in words."""
        return {Stage.ACCEPTED: "accepted", Stage.DONE: "executed", Stage.STARTED: "started"}.get(
            self.stage, f"under way, {self.detail} %")

    def __repr__(self) -> str:
        name = Code(self.code).name.lower() if self.code in Code._value2member_map_ else f"code {self.code}"
        what = self.stage_text if self.good else "refused: "
        detail = f", the last was {self.detail}" if self.reason == Reason.SEQUENCE else \
            f", rule {self.detail}" if self.detail else ""
        why = "" if self.good else self.reason.name.lower() + detail
        where = "" if self.stored_on is None else f" of list {self.stored_on}"
        return f"<{name} {self.sequence}{where} {what}{why}, t = {self.t / 1e9:g} s>"


def origins(number: int) -> tuple[int | None, int | None, int | None]:
    """(list, monitor, rule) of the member `origin` of a CommandReport."""
    kinds = [(OF_LIST, OF_MONITOR), (OF_MONITOR, OF_RULE), (OF_RULE, OF_RULE + RULES)]
    stored_on, monitor, rule = (number - low if low <= number < high else None for low, high in kinds)
    return stored_on, monitor, rule


class Stored(NamedTuple):
    """A command that is stored on board, as a report of its list has it."""
    time: int                   # [ns]
    step: int
    size: int                   # [bytes] of the packet
    crc: int                    # of list, step, time and packet
    code: int


def stored(data: bytes) -> list[Stored]:
    """What the report of Code.LIST has read back: the commands of a list, in the order of their execution."""
    return [Stored(*row) for row in packing.iter_unpack(">qHHHH", data)]


def storing(packets: Iterable[bytes]) -> list[Stored]:
    """The same of a list that is made by these packets of Code.STORE."""
    rows = [(packet, *packing.unpack_from(LAYOUTS[Code.STORE], packet, STORED - STORE_SIZE)) for packet in packets]
    return sorted(Stored(time, step, len(packet) - STORED, crc, packet[STORED + 6])
                  for packet, crc, _, step, time in rows)


class Text(NamedTuple):
    """A text of an interpreter in flight: a TelemetryText."""
    t: int                      # [ns] of flight
    kind: Kind
    sequence: int               # of the command that started the procedure or had the text
    line: int                   # of the script; 0: none
    text: str
    lost: int                   # texts before it, for which there was no room

    def __repr__(self) -> str:
        kind = self.kind.name.lower().replace("_", " ")
        line = f", line {self.line}" if self.line else ""
        return f"<{kind}{line}: {self.text!r}, t = {self.t / 1e9:g} s>"


class Event(NamedTuple):
    """An event of a module: an EventRecord of the log of events."""
    t: int                      # [ns]
    output: str                 # flight.monitors.event
    name: str                   # FIRED
    severity: str               # info, low, medium, high
    arguments: dict[str, float]
    number: int                 # counts the records
    before: int                 # events of the output before this one that were not logged
    text: str                   # FIRED monitor 3, value 0.21

    def __str__(self) -> str:
        """flight.monitors: FIRED monitor 3, value 0.21"""
        return f"{self.output.removesuffix('.event')}: {self.text}"

    def __repr__(self) -> str:
        before = f", {self.before} before it not logged" if self.before else ""
        return f"<{self}, {self.severity}, t = {self.t / 1e9:g} s{before}>"


class Selected(NamedTuple):
    """A report of housekeeping."""
    t: int                      # [ns]
    report: int                 # its place
    values: dict[str, Any] | None   # path -> value; None: what it has is not known here: Dictionary.learn()
    left_out: list[int]         # the places of choices that flight does not have
    data: bytes                 # the numbers, big-endian


class Telemetry(NamedTuple):
    """A packet of telemetry."""
    path: str                   # flight.control.torque; "housekeeping", "reports", "texts" or one of SERVICES
    sequence: int
    time: float                 # [s] of flight, by the header: to 2^-16 s
    content: Any                # of an output: field -> value; else a Report, a Text, an Event, Selected, or bytes


def decoded(dictionary: Dictionary, packet: bytes) -> Telemetry:
    """A packet of telemetry by the dictionary. Raises SetupError if it is none."""
    if len(packet) < 16 or len(packet) != int.from_bytes(packet[4:6], "big") + 7:
        raise SetupError(f"a packet of telemetry has 16 bytes or more, and the length of its header; found "
                         f"{packet[:16].hex()}..., {len(packet)} bytes")
    stream, sequence, _, seconds, part = packing.unpack_from(">HHHIH", packet)
    mark = {"little": "<", "big": ">"}[dictionary.order]
    if not 0 <= stream - dictionary.telemetry <= OUTPUTS + len(dictionary.outputs) + len(SERVICES):
        raise SetupError(f"{dictionary.name} sends no packet {packet[:16].hex()}...")
    try:
        content, path = _content(dictionary, stream, packet[16:], mark)
    except (packing.error, ValueError) as error:
        raise SetupError(f"the packet {packet[:16].hex()}... is damaged: {error}") from None
    return Telemetry(path, sequence & 0x3FFF, seconds + part / 65536, content)


def _content(dictionary: Dictionary, stream: int, body: bytes, mark: str) -> tuple[Any, str]:
    """(content, path) of a packet."""
    place = stream - dictionary.telemetry
    if place == HOUSEKEEPING:
        return _state(body, mark), "housekeeping"
    if place == REPORTS:
        t, number, code, stage, reason, detail, n, origin = packing.unpack_from(mark + REPORT, body)
        return Report(t, number, code, Stage(stage), Reason(reason), detail, body[DATA:DATA + n],
                      *origins(origin)), "reports"
    if stream == dictionary.texts:
        t, kind, number, line, n, lost = packing.unpack_from(mark + TEXT, body)
        return Text(t, Kind(kind), number, line, body[DATA:DATA + n].decode(errors="replace"), lost), "texts"
    if stream > dictionary.texts:
        path = SERVICES[stream - dictionary.texts - 1]
        return (_event(dictionary, body) if path == "events" else _selected(dictionary, body) if path == "selected"
                else body), path
    output = dictionary.outputs[place - OUTPUTS]
    if len(body) != output.size:
        raise SetupError(f"{output.path} has {output.size} bytes; the packet has {len(body)}")
    return values(output.fields, body, mark), output.path


def _state(body: bytes, mark: str) -> dict[str, Any]:
    """Housekeeping. last: the sequence of the last command by the link from the ground; None: there was none."""
    numbers = iter(packing.unpack_from(mark + STATE, body))
    state: dict[str, Any] = {name: next(numbers) if n == 1 else [next(numbers) for _ in range(n)]
                             for name, _, n in HOUSEKEEPING_RECORD}
    state["reasons"] = {Reason(i): n for i, n in enumerate(state["reasons"]) if n}
    state["last"] = state["last"] if state.pop("begun") else None
    return state


def _event(dictionary: Dictionary, body: bytes) -> Event:
    t, number, before, place, severity, kind, *arguments = packing.unpack(">" + EVENT, body)
    output = dictionary.outputs[place] if place < len(dictionary.outputs) else None
    unknown = EventId(kind, f"event {kind}", "", tuple((f"argument {i}", "-") for i in range(4)), "")
    event = next((known for known in output.events if known.id == kind), unknown) if output else unknown
    return Event(t, output.path if output else f"output {place}", event.name,
                 dict(enumerate(SEVERITIES, 1)).get(severity, str(severity)),
                 dict(zip((name for name, _ in event.arguments), arguments)), number, before, event.text(arguments))


def _selected(dictionary: Dictionary, body: bytes) -> Selected:
    t, report, crc, left_out, n = packing.unpack_from(SELECTED, body)
    start = packing.calcsize(SELECTED)
    data, at, chosen = body[start:start + n], 0, {}
    for i, choice in enumerate(dictionary.choices.get(crc, [])):
        if not left_out >> i & 1 and choice.field:
            end = at + ELEMENTS[choice.field.type].size * math.prod(choice.shape)
            chosen[choice.path] = value_of(choice.field, data[at:end], choice.shape, ">")
            at = end
    return Selected(t, report, chosen if crc in dictionary.choices else None,
                    [i for i in range(CHOICES) if left_out >> i & 1], data)

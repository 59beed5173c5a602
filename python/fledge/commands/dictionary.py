# SPDX-License-Identifier: Apache-2.0
"""What a mission can be commanded and what it sends: its modes, parameters, events and outputs."""
from __future__ import annotations

import binascii
import json
import re
import struct as packing
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field as with_default
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge.commands.fields import Field, byte_runs, described, leaves, parameters, place_of, values
from fledge.commands.protocol import (ARGUMENTS, CHOICES, COMMAND_MAX, COMMANDS, DATA_MAX, FLAGS, HEADER,
                                      HOUSEKEEPING, NAMED, NUMBERS, OUTPUTS, PROCEDURE_MAX, REPORT_LEAST, REPORTS,
                                      TELEMETRY, WHY, Code, Kind, Reason, cuts)
from fledge.elements import ELEMENTS
from fledge.errors import SetupError
from fledge.frames import ROOM, Frames
from introspect.comment import event as event_of
from introspect.model import snake

if TYPE_CHECKING:
    from fledge.commands.reports import Report


class Rule(NamedTuple):
    """CommandRule of flight/command/rules.h."""
    name: str
    text: str
    offset: int
    n: int
    row: int
    rows_at: int | None         # None: all rows
    flags: int
    number: str                 # f64, ...
    low: float
    high: float


@dataclass
class Block:
    """The parameters of a module."""
    path: str                   # flight.control
    type: str
    size: int                   # [bytes]
    configuration: bool         # a change publishes it
    fields: list[Field]
    runs: list[tuple[int, int]]  # (width in bytes, how many) of its numbers
    rules: list[Rule]


@dataclass(frozen=True)
class EventId:
    """An event that a module may report, by its header."""
    id: int
    name: str                   # FIRED
    severity: str               # info, low, medium, high
    arguments: tuple[tuple[str, str], ...]      # (name, unit)
    meaning: str

    def text(self, arguments: Sequence[float]) -> str:
        """FIRED monitor 3, value 0.21"""
        parts = [f"{name} {value:g}" + ("" if unit in ("-", "SI") else f" {unit}")
                 for (name, unit), value in zip(self.arguments, arguments)]
        return f"{self.name} {', '.join(parts)}".rstrip()


@dataclass
class Output:
    """A message that flight puts out, and the stream of its packets."""
    path: str                   # flight.control.torque
    type: str
    size: int
    stream: int
    fields: list[Field]
    events: list[EventId] = with_default(default_factory=list)  # of a FlightEvent


class Choice(NamedTuple):
    """Numbers of a report of housekeeping."""
    path: str                   # flight.motor.command.u[0]
    field: Field | None         # None: the place has none
    shape: list[int]            # of what was chosen of it


@dataclass
class Dictionary:
    name: str
    stream: int                 # of commands
    telemetry: int              # the first stream of telemetry
    modes: list[str]
    events: list[str]
    blocks: list[Block]
    outputs: list[Output]
    order: str = "big"          # of telemetry's numbers; "little": on the software bus of cFS on such a machine
    frames: Frames | None = None    # what its links carry instead of packets
    #: mode -> when it may be entered, in words, of those that may not always
    guards: dict[str, str] = with_default(default_factory=dict)
    #: by the CRC of its choices, what the packets of a report of housekeeping have: learn()
    choices: dict[int, list[Choice]] = with_default(default_factory=dict, compare=False, repr=False)

    @classmethod
    def of(cls, name: str, modules: Iterable[tuple[str, Any, bool]], modes: Sequence[str], events: Sequence[str],
           stream: int = COMMANDS, telemetry: int = TELEMETRY, order: str = "big") -> Dictionary:
        """modules: (path, struct, whether it is of the configuration) of each, in the order of the mission."""
        modules = list(modules)
        services: dict[str, str] = {}
        for path, struct, _ in modules:
            if struct.service and services.setdefault(struct.name, path) != path:
                raise SetupError(f"{path} is another {struct.name}: {services[struct.name]} is there already, and a "
                                 "process has one of a kind, which its commands address")
        blocks = [block for path, struct, configuration in modules
                  if (block := block_of(path, struct, configuration))]
        ports = [(f"{path}.{f.name}", f.struct, struct) for path, struct, _ in modules for f in struct.fields
                 if f.group == "out"]
        outputs = [Output(path, struct.name, struct.size, telemetry + OUTPUTS + i, described(struct.fields),
                          events_of(module) if struct.name == "FlightEvent" else [])
                   for i, (path, struct, module) in enumerate(ports)]
        return cls(name, stream, telemetry, list(modes), list(events), blocks, outputs, order)

    @cached_property
    def version(self) -> int:
        """Changes with the names, places, types and units of all that it lists, which stay; not with the streams."""
        lists = [self.modes, self.events, [(b.path, b.configuration, _layout(b.fields)) for b in self.blocks],
                 [(o.path, _layout(o.fields), *[(e.id, e.name, e.arguments) for e in o.events]) for o in self.outputs]]
        return binascii.crc_hqx(repr(lists).encode(), 0xFFFF)

    @property
    def room(self) -> int:
        """[bytes] of the queue: for all blocks and a procedure at one instant, and some more."""
        return sum(b.size + HEADER * len(cuts(0, b.size)) + 14 for b in self.blocks) + 1024 + PROCEDURE_MAX

    @property
    def packets(self) -> int:
        """How many commands all blocks and a procedure at one instant are, and some more: a power of two."""
        n = sum(1 + len(cuts(0, b.size)) for b in self.blocks) + 8 + PROCEDURE_MAX // DATA_MAX
        return 1 << (n - 1).bit_length()

    @property
    def longest(self) -> int:
        """[bytes] of the longest packet of telemetry."""
        return max([REPORT_LEAST + DATA_MAX, *(HEADER + o.size for o in self.outputs)])

    @property
    def uplink(self) -> int:
        """[bytes] of the longest unit of the queue of commands."""
        return ROOM if self.frames else COMMAND_MAX

    @property
    def downlink(self) -> int:
        """[bytes] of the longest unit of the queue of telemetry."""
        return self.frames.unit if self.frames else self.longest

    @property
    def texts(self) -> int:
        """The stream of texts."""
        return self.telemetry + OUTPUTS + len(self.outputs)

    def block(self, path: str) -> tuple[int, Block]:
        """(place, block) of a module's path."""
        return place_of(self.blocks, [b.path for b in self.blocks], path, "module with parameters", self.name)

    def output(self, path: str) -> tuple[int, Output]:
        return place_of(self.outputs, [o.path for o in self.outputs], path, "output", self.name)

    def number(self, path: str, measure: str = "") -> tuple[int, Field, int, int]:
        """(place of the output, field, [bytes] from the output's beginning, how many) of a number of an output, as
        "flight.tracking.error.sigma_BR[2]", or with a measure of all numbers of a field; "any": of either."""
        for place, output in enumerate(self.outputs):
            for name, field, at in leaves(output.fields, prefix=f"{output.path}."):
                index = path.removeprefix(name)
                n = field.size // ELEMENTS[field.type].size
                if index == path or index and not re.fullmatch(r"(\[\d+\])+", index):
                    continue
                indices = [int(digits) for digits in re.findall(r"\d+", index)]
                if field.type == "char" or measure not in ("", "norm", "max_abs", "any"):
                    break
                if measure and not indices:
                    return place, field, at, n
                if (measure in ("", "any") and len(indices) == len(field.shape)
                        and all(map(int.__lt__, indices, field.shape))):
                    flat = 0
                    for i, length in zip(indices, field.shape):
                        flat = flat * length + i
                    return place, field, at + flat * ELEMENTS[field.type].size, 1
        raise SetupError(f"{path} is no number of an output of {self.name}: give one, as in "
                         "'flight.tracking.error.sigma_BR[2]', or a field and the measure 'norm' or 'max_abs'")

    def learn(self, reports: bytes) -> None:
        """Take note of reports of housekeeping, big-endian as commands write them and flight reads them back, so that
        their packets can be decoded."""
        size = 16 + 8 * CHOICES
        for at in range(0, len(reports) - size + 1, size):
            rows = reports[at + 16:at + 16 + 8 * min(int.from_bytes(reports[at + 12:at + 16], "big"), CHOICES)]
            self.choices[binascii.crc_hqx(rows, 0xFFFF)] = [
                self._choice(*row) for row in packing.iter_unpack(">4H", rows)]

    def _choice(self, place: int, offset: int, kind: int, n: int) -> Choice:
        """The field and shape of some numbers of an output."""
        for path, field, at in leaves(self.outputs[place].fields if place < len(self.outputs) else []):
            width = ELEMENTS[field.type].size
            if at <= offset < at + field.size and field.type == dict(enumerate(NUMBERS)).get(kind):
                path, first = f"{self.outputs[place].path}.{path}", (offset - at) // width
                if n * width == field.size:
                    return Choice(path, field, list(field.shape))
                index = ""
                for length in reversed(field.shape):
                    first, i = divmod(first, length)
                    index = f"[{i}]{index}"
                return Choice(path + index, field, [] if n == 1 else [n])
        return Choice(f"output {place}, byte {offset}", None, [])

    # --- in words ---

    def command(self, packet: bytes) -> str:
        """A command in words: "write flight.control.K"."""
        code, place = packet[6], int.from_bytes(packet[10:12], "big")
        name = Code(code).name.lower().replace("_", " ") if code in Code._value2member_map_ else f"the code {code}"
        file = " " + packet[12:].decode(errors="replace") if code in NAMED else ""
        names = {int(Code.MODE): self.modes, int(Code.ARM): self.events,
                 int(Code.TELEMETRY): [output.path for output in self.outputs]}.get(code, [])
        if code in (Code.TABLE_LOAD, Code.TABLE_DUMP, Code.CHECK) and place < len(self.blocks):
            return f"{name} {self.blocks[place].path}{file}"
        if code in (Code.WRITE, Code.STAGE, Code.COMMIT, Code.PUBLISH, Code.READ) and place < len(self.blocks):
            block = self.blocks[place]
            low, whole = int.from_bytes(packet[12:16], "big"), code in (Code.COMMIT, Code.PUBLISH)
            high = low + (int.from_bytes(packet[16:18], "big") if code == Code.READ else len(packet) - HEADER)
            fields = [] if whole else [f.name for f in block.fields if f.offset < high and low < f.offset + f.size]
            return f"{name} {block.path}" + (f".{fields[0]}" if len(fields) == 1 else
                                             f" ({', '.join(fields)})" if fields else "")
        if place < len(names):
            disarms = code == Code.ARM and packet[12:14] == b"\0\0"
            return f"{'disarm' if disarms else name} {names[place]}"
        return name + file

    def written(self, packet: bytes) -> list[str]:
        """The parameters that a command writes or stages, wholly or in part: "flight.control.K", of structs their
        fields; of a commit, and of a table that it loads, all of the module."""
        code, place = packet[6], int.from_bytes(packet[10:12], "big")
        if (packet[:2] + packet[8:10] != packing.pack(">2H", self.stream, self.version) or place >= len(self.blocks)
                or code not in (Code.WRITE, Code.STAGE, Code.COMMIT, Code.TABLE_LOAD)):
            return []
        block, low = self.blocks[place], int.from_bytes(packet[12:16], "big")
        low, high = (low, low + len(packet) - HEADER) if code in (Code.WRITE, Code.STAGE) else (0, block.size)
        return [f"{block.path}.{path}" for path, f, at in leaves(block.fields) if at < high and low < at + f.size]

    def refusal(self, report: Report, packet: bytes | None) -> str:
        """What was refused, when and why. packet: that of the report, if it is known."""
        what = self.command(packet) if packet else repr(report).split()[0].removeprefix("<")
        when = (f"at {report.t / 1e9:g} s" if report.stage else
                f"after {report.t / 1e9:g} s" if report.t >= 0 else "before the first instant")
        why = WHY.get(report.reason, "")
        block = int.from_bytes(packet[10:12], "big") if packet else len(self.blocks)
        if report.reason in (Reason.RULE, Reason.INITIAL) and block < len(self.blocks):
            if report.detail < len(rules := self.blocks[block].rules):
                rule = rules[report.detail]
                why += f": {self.blocks[block].path}.{rule.name}" + (
                    f" must be {rule.text}" if report.reason == Reason.RULE else "")
        if report.reason == Reason.GUARDED and report.code == Code.MODE and packet:
            why += f": {self.modes[block]} is entered only {self.guards.get(self.modes[block], '')}"
        if report.code == Code.FILE_SEND and report.reason == Reason.FAILED:
            why += f": CFDP ended it by its condition {report.detail}"
        return f"{what}, {when}: {why}"

    # --- as a file ---

    def text(self) -> str:
        """The file MISSION_packets.json."""
        commands = [{"name": code.name.lower(), "code": int(code), "arguments": ARGUMENTS[code]} for code in Code]
        whole = {"name": self.name, "version": self.version, "commands": {"stream": self.stream, "order": "big",
                 "list": commands, "reasons": {r.name.lower(): int(r) for r in Reason}},
                 "telemetry": {"stream": self.telemetry, "housekeeping": self.telemetry + HOUSEKEEPING,
                               "reports": self.telemetry + REPORTS, "texts": self.texts,
                               "kinds": {k.name.lower(): int(k) for k in Kind}, "order": self.order},
                 **({"frames": asdict(self.frames)} if self.frames else {}),
                 "modes": self.modes, **({"guards": self.guards} if self.guards else {}), "events": self.events,
                 "modules": [_plain(b) for b in self.blocks], "outputs": [_plain(o) for o in self.outputs]}
        return json.dumps(whole, indent=1) + "\n"

    @classmethod
    def load(cls, file: Path | str) -> Dictionary:
        """Read a dictionary from a file MISSION_packets.json."""
        return cls.read(Path(file).read_text(encoding="utf-8"), str(file))

    @classmethod
    def read(cls, text: str, file: str) -> Dictionary:
        """That of the text of such a file. file: its name in errors."""
        whole = json.loads(text)

        def fields(rows: list[dict[str, Any]]) -> list[Field]:
            for row in rows:
                row["fields"] = fields(row["fields"])
            return [Field(**row) for row in rows]

        blocks = [Block(**(row | {"fields": fields(row["fields"]), "runs": [tuple(r) for r in row["runs"]],
                                  "rules": [Rule(*r) for r in row["rules"]]})) for row in whole["modules"]]
        outputs = [Output(**(row | {"fields": fields(row["fields"]), "events": [
            EventId(**(e | {"arguments": tuple(map(tuple, e["arguments"]))})) for e in row["events"]]}))
            for row in whole["outputs"]]
        dictionary = cls(whole["name"], whole["commands"]["stream"], whole["telemetry"]["stream"], whole["modes"],
                         whole["events"], blocks, outputs, whole["telemetry"]["order"])
        dictionary.guards = whole.get("guards", {})
        if frames := whole.get("frames"):
            frames["keys"] = tuple(frames["keys"])
            dictionary.frames = Frames(**frames)
        if dictionary.version != whole["version"]:
            raise SetupError(f"{file}: its version is {whole['version']}, but that of its lists {dictionary.version}: "
                             "it was changed by hand, or is of another version of Fledge; export it again")
        return dictionary


def _plain(row: Block | Output) -> dict[str, Any]:
    return {key: [list(r) for r in value] if key in ("rules", "runs") else value for key, value in asdict(row).items()}


def events_of(module: Any) -> list[EventId]:
    """The events that a module may report, by the table of its header."""
    if module.events is None:
        return []
    begin = f"{snake(module.name).upper()}_"
    rows = [(value, name.removeprefix(begin), event_of(doc)) for name, value, doc in module.events[2]]
    return [EventId(value, name, event.severity, event.arguments, event.meaning) for value, name, event in rows]


def _layout(fields: Sequence[Field]) -> list[Any]:
    return [(f.name, f.type, tuple(f.shape), f.offset, f.unit, sorted(f.enumerators.items()), _layout(f.fields))
            for f in fields]


def frames_of(struct: Any, memory: bytes) -> Frames | None:
    """The frames of a module, if it is a SpaceLink. memory: the bytes of its struct."""
    if struct.name != "SpaceLink":
        return None
    fields, start, end = parameters(struct)
    return Frames.of(values(described(fields, start), memory[start:end], "<" if sys.byteorder == "little" else ">"))


def block_of(path: str, struct: Any, configuration: bool) -> Block | None:
    """The parameters of a module; None if it has none."""
    fields, start, end = parameters(struct)
    if not fields:
        return None
    return Block(path, struct.name, end - start, configuration, described(fields, start), byte_runs(fields),
                 list(rules_of(fields, start)))


def rules_of(fields: Sequence[Any], start: int, prefix: str = "", base: int = 0, initial: bool = False
             ) -> Iterator[Rule]:
    """The rules of the headers' fields; their block begins at `start`."""
    places = {f.name: f.offset - start + base for f in fields}
    for f in fields:
        at = f.offset - start + base
        if f.type == "struct":
            for i, k in enumerate(range(at, at + f.size, f.struct.size)):
                index = f"[{i}]" if f.shape else ""
                yield from rules_of(f.struct.fields, 0, f"{prefix}{f.name}{index}.", k, initial or f.initial)
            continue
        if f.type == "char" or f.spare:
            continue
        low, high, low_open, high_open = f.bounds
        flags = sum(FLAGS[name] for name, on in (
            ("FLEDGE_HAS_LO", low is not None), ("FLEDGE_HAS_HI", high is not None),
            ("FLEDGE_LO_OPEN", low_open and low is not None), ("FLEDGE_HI_OPEN", high_open and high is not None),
            ("COMMAND_NON_ZERO", f.non_zero), ("COMMAND_INERTIA", f.inertia),
            ("COMMAND_START", initial or f.initial)) if on)
        if not ELEMENTS[f.type].is_float and not flags:
            continue                                   # all are allowed
        n = f.size // ELEMENTS[f.type].size
        rule = f.rule.removeprefix("required").removeprefix(", ")
        text = "0 or of size 1e-100 to 1e100" if ELEMENTS[f.type].is_float else "whole"
        text += f", {rule}" if rule else ""
        text += f" {f.unit}" if f.unit not in ("", "-") and (low is not None or high is not None) else ""
        row = n // f.shape[0] if f.shape and (f.count or len(f.shape) > 1) else n if n == 3 else 1
        yield Rule(prefix + f.name, text, at, n, row, places[f.count] if f.count else None, flags, f.type, low or 0.0,
                   high or 0.0)

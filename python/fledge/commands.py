# SPDX-License-Identifier: Apache-2.0
"""Commands to a flight process as packets, flight/command/command.h.

    packets = Packets(Dictionary.load("nadir_spin_packets.json"))
    packets.mode("science")                     # the bytes of one command
    packets.write("flight.control", K=3.0)      # a list of them; numbers in the units of the header
    packets.load("flight.control", block)       # the whole block of a module

A Dictionary is what a mission can be commanded and what it sends: the export writes it as MISSION_packets.json, and the
desktop makes the same one of the live objects.
"""
from __future__ import annotations

import binascii
import json
import math
import re
import struct as packing
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field as with_default
from enum import IntEnum
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any, NamedTuple

from fledge.elements import ELEMENTS, short_names
from fledge.errors import SetupError, did_you_mean, listed
from fledge.frames import ROOM, Frames
from introspect.comment import SEVERITIES, event as event_of
from introspect.model import snake

COMMANDS, TELEMETRY = 0x1880, 0x0880     # the streams of a mission's own board
HOUSEKEEPING, REPORTS, OUTPUTS = 0, 1, 2  # of telemetry: places behind its first stream; texts follow the outputs,
SERVICES = ["events", "selected", "files"]  # and these the texts
DATA_MAX = 512                           # [bytes] of parameters, bytecode or text in one command or report
PROCEDURE_MAX = 2048                     # [bytes] of bytecode: a slot's room
HEADER = 16                              # [bytes] of a command in front of them, and of a packet of telemetry
COMMAND_MAX = HEADER + DATA_MAX
REPORT_LEAST = HEADER + 24               # with a CommandReport or a TelemetryText
ALL = 0xFFFF                             # all outputs
TURNS = 10_000                           # of a procedure in one instant, unless the caller says
LARGEST = 1e100                          # of a parameter
STORED_MAX = 112                         # [bytes] of a command that is stored on board
NAME_MAX = 127                           # [bytes] of a file's name on board
CHOICES = 16                             # numbers of a report of housekeeping
UNIT_STATES = ["off", "primary", "redundant", "faulted"]     # UnitState, from 1
LISTS = 16                               # of stored commands: 0 has those of absolute times, the others are sequences


class Code(IntEnum):
    """Function codes."""
    NOOP = 0
    RESET_COUNTERS = 1
    MODE = 2
    WRITE = 3
    STAGE = 4
    COMMIT = 5
    PUBLISH = 6
    RESET_FLIGHT = 7
    ARM = 8
    READ = 9
    TELEMETRY = 10
    STAGE_PROCEDURE = 11
    START_PROCEDURE = 12
    STOP_PROCEDURE = 13
    EVALUATE = 14
    STORE = 15
    DELETE = 16
    CONTROL = 17
    LIST = 18
    PDU = 19
    FILE_SEND = 20
    FILE_CONTROL = 21
    FILE_REMOVE = 22
    TABLE_LOAD = 23
    TABLE_DUMP = 24
    CHECK = 25
    EVENTS = 26
    UNIT = 27


class Action(IntEnum):
    """What Code.CONTROL does with a list of stored commands."""
    START = 0
    STOP = 1
    HOLD = 2
    RELEASE = 3
    INHIBIT = 4
    ALLOW = 5


class FileAction(IntEnum):
    """What Code.FILE_CONTROL does with a transaction of files."""
    SUSPEND = 0
    RESUME = 1
    CANCEL = 2


class Stage(IntEnum):
    """How far a command is."""
    ACCEPTED = 0                # or refused when it came
    DONE = 1                    # executed, or refused then
    STARTED = 2                 # executed; what it began goes on, and is reported again
    UNDER_WAY = 3


class Reason(IntEnum):
    """Why a command was refused."""
    OK = 0
    LENGTH = 1
    CHECKSUM = 2
    STREAM = 3
    UNKNOWN = 4
    VERSION = 5
    PLACE = 6
    VALUE = 7
    RULE = 8
    INITIAL = 9
    BUSY = 10
    NOT_STAGED = 11
    CRC = 12
    ABSENT = 13
    RUNNING = 14
    BYTECODE = 15
    FAILED = 16
    SEQUENCE = 17
    LATE = 18
    INHIBITED = 19
    FULL = 20
    ROLE = 21
    LAST = 22
    GUARDED = 23
    CONFLICT = 24


WHY = {
    Reason.LENGTH: "its length is wrong", Reason.CHECKSUM: "its checksum is wrong",
    Reason.STREAM: "it is for another stream", Reason.UNKNOWN: "there is no such command",
    Reason.VERSION: "it is for another version of the mission's dictionary",
    Reason.PLACE: "it names a mode, module, event, output, slot, number, file or transaction that is not there",
    Reason.VALUE: "one of its arguments is out of range", Reason.RULE: "the parameters would break a rule",
    Reason.INITIAL: "an initial value counts only before flight's first instant",
    Reason.BUSY: "the commands that wait for the next instant leave no room",
    Reason.NOT_STAGED: "nothing of this module is staged", Reason.CRC: "what is staged is not what it names",
    Reason.ABSENT: "this flight software has no interpreter, none that evaluates text, or not this service",
    Reason.RUNNING: "a procedure or list runs, stands or is held already",
    Reason.BYTECODE: "the procedure is no bytecode for this interpreter",
    Reason.FAILED: "it was not done to its end",
    Reason.SEQUENCE: "it came before, or a later one did", Reason.LATE: "it was stored and came due too long ago",
    Reason.INHIBITED: "its list is inhibited",
    Reason.FULL: "the store of files is full, or too many files are under way",
    Reason.ROLE: "whose key protected its frame may not give it",
    Reason.LAST: "it would leave no unit of its kind in use",
    Reason.GUARDED: "the mode's condition does not hold",
    Reason.CONFLICT: "another list asks for another mode at the same time"}


class Kind(IntEnum):
    """What a text of telemetry is about."""
    SCRIPT = 0
    PROCEDURE_STARTED = 1
    PROCEDURE_ENDED = 2
    PROCEDURE_STOPPED = 3
    PROCEDURE_KILLED = 4
    PRINTED = 5
    RESULT = 6
    ERROR = 7


ARGUMENTS: dict[Code, list[str]] = {
    Code.NOOP: [], Code.RESET_COUNTERS: [], Code.RESET_FLIGHT: ["version"], Code.MODE: ["version", "mode"],
    Code.WRITE: ["version", "module", "offset", "bytes"], Code.STAGE: ["version", "module", "offset", "bytes"],
    Code.COMMIT: ["version", "module", "crc"], Code.PUBLISH: ["version", "module"],
    Code.ARM: ["version", "event", "on"], Code.READ: ["version", "module", "offset", "n"],
    Code.TELEMETRY: ["version", "output", "on", "every"],
    Code.STAGE_PROCEDURE: ["version", "slot", "offset", "bytes"],
    Code.START_PROCEDURE: ["version", "slot", "length", "crc", "turns"], Code.STOP_PROCEDURE: ["version", "slot"],
    Code.EVALUATE: ["version", "zero", "turns", "bytes"],
    Code.STORE: ["version", "crc", "list", "step", "time", "bytes"], Code.DELETE: ["version", "list", "step"],
    Code.CONTROL: ["version", "list", "action", "crc"], Code.LIST: ["version", "list"],
    Code.PDU: ["bytes"], Code.FILE_SEND: ["version", "class", "bytes"],
    Code.FILE_CONTROL: ["version", "file_action", "own", "transaction"], Code.FILE_REMOVE: ["version", "zero", "bytes"],
    Code.TABLE_LOAD: ["version", "module", "bytes"], Code.TABLE_DUMP: ["version", "module", "bytes"],
    Code.CHECK: ["version", "module"], Code.EVENTS: ["version"],
    Code.UNIT: ["version", "unit", "state", "even"]}
NAMED = (Code.FILE_SEND, Code.FILE_REMOVE, Code.TABLE_LOAD, Code.TABLE_DUMP)     # their bytes are a name


# --- the dictionary --------------------------------------------------------------------------------

@dataclass
class Field:
    """A field of parameters or of a message."""
    name: str
    type: str                   # f64, ..., enum, char, struct
    offset: int                 # [bytes] in its block, message or struct
    size: int                   # [bytes] of all its elements
    shape: list[int]
    unit: str
    meaning: str
    enumerators: dict[str, int] = with_default(default_factory=dict)
    fields: list[Field] = with_default(default_factory=list)    # of a struct
    rule: str = ""              # "> 0"


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


NUMBERS = ["f64", "f32", "i8", "u8", "i16", "u16", "i32", "u32", "i64", "u64", "char", "enum"]    # FledgeType
FLAGS = {"FLEDGE_HAS_LO": 1, "FLEDGE_HAS_HI": 2, "FLEDGE_LO_OPEN": 4, "FLEDGE_HI_OPEN": 8, "COMMAND_NON_ZERO": 16,
         "COMMAND_INERTIA": 32, "COMMAND_START": 64}


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
    """An event that a module may say, by its header."""
    id: int
    name: str                   # FIRED
    severity: str               # info, low, medium, high
    arguments: tuple[tuple[str, str], ...]      # (name, unit)
    meaning: str

    def text(self, arguments: Sequence[float]) -> str:
        """FIRED monitor 3, value 0.21"""
        found = [f"{name} {value:g}" + ("" if unit in ("-", "SI") else f" {unit}")
                 for (name, unit), value in zip(self.arguments, arguments)]
        return f"{self.name} {', '.join(found)}".rstrip()


@dataclass
class Output:
    """A message that flight puts out, and the stream of its packets."""
    path: str                   # flight.control.torque
    type: str
    size: int
    stream: int
    fields: list[Field]
    events: list[EventId] = with_default(default_factory=list)  # of a FlightEvent


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

    @property
    def version(self) -> int:
        """Changes with the names, places, types and units of all that it lists; not with the streams."""
        lists = [self.modes, self.events, [(b.path, b.configuration, _layout(b.fields)) for b in self.blocks],
                 [(o.path, _layout(o.fields), *[(e.id, e.name, e.arguments) for e in o.events]) for o in self.outputs]]
        return binascii.crc_hqx(repr(lists).encode(), 0xFFFF)

    @property
    def room(self) -> int:
        """[bytes] of the queue: for all blocks and a procedure at one instant, and some more."""
        return sum(sum(map(len, _parts(16, b.size))) + 14 for b in self.blocks) + 1024 + PROCEDURE_MAX

    @property
    def packets(self) -> int:
        """How many commands all blocks and a procedure at one instant are, and some more: a power of two."""
        n = sum(1 + len(_parts(16, b.size)) for b in self.blocks) + 8 + PROCEDURE_MAX // DATA_MAX
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
        return _place(self.blocks, [b.path for b in self.blocks], path, "module with parameters", self.name)

    def output(self, path: str) -> tuple[int, Output]:
        return _place(self.outputs, [o.path for o in self.outputs], path, "output", self.name)

    def number(self, path: str, measure: str = "") -> tuple[int, Field, int, int]:
        """(place of the output, field, [bytes] from the output's beginning, how many) of a number of an output, as
        "flight.tracking.error.sigma_BR[2]", or with a measure of all numbers of a field; "any": of either."""
        for place, output in enumerate(self.outputs):
            for name, field, at in leaves(output.fields, prefix=f"{output.path}."):
                index = path.removeprefix(name)
                n = field.size // ELEMENTS[field.type].size
                if index == path or index and not re.fullmatch(r"(\[\d+\])+", index):
                    continue
                found = [int(one) for one in re.findall(r"\d+", index)]
                if field.type == "char" or measure not in ("", "norm", "max_abs", "any"):
                    break
                if measure and not found:
                    return place, field, at, n
                if (measure in ("", "any") and len(found) == len(field.shape)
                        and all(map(int.__lt__, found, field.shape))):
                    flat = 0
                    for i, length in zip(found, field.shape):
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
        """What numbers of an output are."""
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
        """What a command asks for: "write flight.control.K"."""
        code, place = packet[6], int.from_bytes(packet[10:12], "big")
        name = Code(code).name.lower().replace("_", " ") if code in Code._value2member_map_ else f"the code {code}"
        file = " " + packet[12:].decode(errors="replace") if code in NAMED else ""
        names = {int(Code.MODE): self.modes, int(Code.ARM): self.events,
                 int(Code.TELEMETRY): [one.path for one in self.outputs]}.get(code, [])
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
        """That of a file MISSION_packets.json."""
        return cls.read(Path(file).read_text(encoding="utf-8"), str(file))

    @classmethod
    def read(cls, text: str, file: str) -> Dictionary:
        """That of the text of such a file. file: its name in errors."""
        whole = json.loads(text)

        def fields(rows):
            return [Field(**{**row, "fields": fields(row["fields"])}) for row in rows]

        blocks = [Block(**{**row, "fields": fields(row["fields"]), "runs": [tuple(r) for r in row["runs"]],
                           "rules": [Rule(*r) for r in row["rules"]]}) for row in whole["modules"]]
        outputs = [Output(**{**row, "fields": fields(row["fields"]), "events": [
            EventId(**(e | {"arguments": tuple(map(tuple, e["arguments"]))})) for e in row["events"]]})
            for row in whole["outputs"]]
        found = cls(whole["name"], whole["commands"]["stream"], whole["telemetry"]["stream"], whole["modes"],
                    whole["events"], blocks, outputs, whole["telemetry"]["order"])
        found.guards = whole.get("guards", {})
        if frames := whole.get("frames"):
            frames["keys"] = tuple(frames["keys"])
            found.frames = Frames(**frames)
        if found.version != whole["version"]:
            raise SetupError(f"{file}: its version is {whole['version']}, but that of its lists {found.version}: it "
                             "was changed by hand, or is of another version of Fledge; export it again")
        return found


def _plain(one):
    return {key: [list(r) for r in value] if key in ("rules", "runs") else value for key, value in asdict(one).items()}


def events_of(module: Any) -> list[EventId]:
    """What a module may say, by the table of its header."""
    if module.events is None:
        return []
    begin = f"{snake(module.name).upper()}_"
    said = [(value, name.removeprefix(begin), event_of(doc)) for name, value, doc in module.events[2]]
    return [EventId(value, name, one.severity, one.arguments, one.meaning) for value, name, one in said]


def _layout(fields):
    return [(f.name, f.type, tuple(f.shape), f.offset, f.unit, sorted(f.enumerators.items()), _layout(f.fields))
            for f in fields]


def _place(items, names, name, what, where):
    if name not in names:
        raise SetupError(f"{where} has no {what} '{name}'{did_you_mean(name, names)} it has "
                         + listed(names, none="none"))
    return names.index(name), items[names.index(name)]


def _unit_state(state):
    return 1 + _place(UNIT_STATES, UNIT_STATES, state, "state", "a unit")[0]


def _parts(head, size):
    """The commands of a block, as empty bytes of their lengths."""
    return [bytes(head + high - low) for low, high in _cuts(0, size)]


def _cuts(at, end):
    """(from, to) of the commands for a part of a block: of one if it holds all, else cut at multiples of DATA_MAX,
    which cut no number of 8 bytes."""
    cuts = range((at // DATA_MAX + 1) * DATA_MAX, end, DATA_MAX) if end - at > DATA_MAX else ()
    places = [at, *cuts, end]
    return list(zip(places, places[1:]))


def described(fields: Sequence[Any], start: int = 0) -> list[Field]:
    """Fields of the tables of the headers as data."""
    return [Field(f.name, f.type, f.offset - start, f.size, list(f.shape), f.unit, f.doc,
                  dict(f.enumerators) if f.type == "enum" else {},
                  described(f.struct.fields) if f.type == "struct" else [], f.rule) for f in fields]


def parameters(struct: Any) -> tuple[list[Any], int, int]:
    """(fields, from, to [bytes]) of the parameters in a module's struct; [], 0, 0 if it has none."""
    fields = [f for f in struct.fields if f.group == "par"]
    return (fields, fields[0].offset, fields[-1].offset + fields[-1].size) if fields else ([], 0, 0)


def frames_of(struct: Any, memory: bytes) -> Frames | None:
    """What a module's link carries, if it is a SpaceLink. memory: its own."""
    if struct.name != "SpaceLink":
        return None
    found, start, end = parameters(struct)
    return Frames.of(values(described(found, start), memory[start:end], "<" if sys.byteorder == "little" else ">"))


def block_of(path: str, struct: Any, configuration: bool) -> Block | None:
    """The parameters of a module; None if it has none."""
    fields, start, end = parameters(struct)
    if not fields:
        return None
    return Block(path, struct.name, end - start, configuration, described(fields, start), byte_runs(fields),
                 list(rules_of(fields, start)))


def leaves(fields: Sequence[Any], base: int = 0, prefix: str = "") -> Iterator[tuple[str, Any, int]]:
    """(path, field, offset) of every field that is no struct; of an array of structs, of each element."""
    for f in fields:
        if f.type == "struct":
            inner = f.fields if isinstance(f, Field) else f.struct.fields
            n = 1
            for length in f.shape:
                n *= length
            for i, at in enumerate(range(base + f.offset, base + f.offset + f.size, f.size // n)):
                yield from leaves(inner, at, f"{prefix}{f.name}" + (f"[{i}]" if f.shape else "") + ".")
        else:
            yield prefix + f.name, f, base + f.offset


def byte_runs(fields: Sequence[Any]) -> list[tuple[int, int]]:
    """(width in bytes, how many) of the numbers in the order of memory, as introspect/emit/orders.py."""
    merged: list[tuple[int, int]] = []
    for _, f, _ in leaves(fields):
        width = ELEMENTS[f.type].size
        n = f.size // width
        if merged and merged[-1][0] == width:
            n += merged.pop()[1]
        merged.append((width, n))
    return merged


def rules_of(fields: Sequence[Any], start: int, prefix: str = "", base: int = 0, initial: bool = False
             ) -> Iterator[Rule]:
    """The rules of the headers' fields, whose block begins at `start`."""
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


# --- packets of commands ---------------------------------------------------------------------------

class Packets:
    """Makes packets by a dictionary, with a sequence of their own.

    sequence: of the first packet. A ground that begins anew counts on from the last one that flight has accepted:
    housekeeping has it, and the report of a refusal for Reason.SEQUENCE.
    """

    def __init__(self, dictionary: Dictionary, sequence: int = 0) -> None:
        self.dictionary = dictionary
        self.sequence = sequence

    def packet(self, code: int, rest: bytes = b"", version: int | None = None) -> bytes:
        """A packet with any code and any bytes behind its header: version, None: that of the dictionary."""
        if code > Code.RESET_COUNTERS and code != Code.PDU:
            rest = (self.dictionary.version if version is None else version).to_bytes(2, "big") + rest
        return self.numbered(packing.pack(">3H2B", self.dictionary.stream, 0, 0, code, 0) + rest)

    def numbered(self, packet: bytes) -> bytes:
        """A command with the next sequence, its length and its checksum."""
        raw = numbered(packet, self.sequence)
        self.sequence += 1
        return checksummed(raw)

    def noop(self) -> bytes:
        return self.packet(Code.NOOP)

    def pdu(self, pdu: bytes) -> bytes:
        """A PDU of CFDP for the files of flight."""
        return self.packet(Code.PDU, pdu)

    def reset_counters(self) -> bytes:
        return self.packet(Code.RESET_COUNTERS)

    def mode(self, mode: Any) -> bytes:
        """Request a mode, by its name or handle."""
        return self.packet(Code.MODE, packing.pack(">H", self._mode(mode)))

    def _mode(self, mode):
        modes = self.dictionary.modes
        return _place(modes, modes, getattr(mode, "name", mode), "mode", self.dictionary.name)[0]

    def arm(self, event: Any, on: bool = True) -> bytes:
        """Arm an event, by its name or handle, or disarm it."""
        events = self.dictionary.events
        place, _ = _place(events, events, getattr(event, "name", event), "event", self.dictionary.name)
        return self.packet(Code.ARM, packing.pack(">HH", place, bool(on)))

    def publish(self, module: str) -> bytes:
        """Publish the parameters of a module of the configuration."""
        return self.packet(Code.PUBLISH, packing.pack(">H", self.dictionary.block(module)[0]))

    def reset(self) -> bytes:
        """Flight begins again; its parameters stay."""
        return self.packet(Code.RESET_FLIGHT)

    def telemetry(self, output: str | None = None, on: bool = True, every: int = 1) -> bytes:
        """Send packets of an output, or of all, at every so many of its writings. output: its path, or "housekeeping",
        which is written at each instant."""
        found = self.dictionary
        place = ALL if output is None else len(found.outputs) if output == "housekeeping" else found.output(output)[0]
        return self.packet(Code.TELEMETRY, packing.pack(">3H", place, bool(on), every))

    def read(self, module: str, field: str | None = None) -> list[bytes]:
        """Read back a field of the parameters, or all; their reports have the bytes."""
        place, block = self.dictionary.block(module)
        one = self._field(block, field) if field else None
        at, end = (one.offset, one.offset + one.size) if one else (0, block.size)
        return [self.packet(Code.READ, packing.pack(">HIH", place, low, high - low)) for low, high in _cuts(at, end)]

    def write(self, module: str, **values: Any) -> list[bytes]:
        """Write fields of the parameters: numbers in the units of the header, arrays as lists, enumerators by name,
        structs as dicts. Fields that lie side by side are one command, as far as it holds them."""
        block = self.dictionary.block(module)[1]
        pieces = {f.offset: encoded(f, values[f.name]) for f in
                  sorted((self._field(block, name) for name in values), key=lambda f: f.offset)}
        return self.write_bytes(module, pieces)

    def write_bytes(self, module: str, pieces: dict[int, bytes]) -> list[bytes]:
        """The same of big-endian bytes by their offsets, which rise."""
        place = self.dictionary.block(module)[0]
        runs: list[tuple[int, bytearray]] = []
        for at, data in pieces.items():
            if runs and runs[-1][0] + len(runs[-1][1]) == at:
                runs[-1][1].extend(data)
            else:
                runs.append((at, bytearray(data)))
        return [self.packet(Code.WRITE, packing.pack(">HI", place, low) + data[low - at:high - at])
                for at, data in runs for low, high in _cuts(at, at + len(data))]

    def load(self, module: str, block: bytes) -> list[bytes]:
        """The whole block of a module, big-endian, staged and committed."""
        place, found = self.dictionary.block(module)
        if len(block) != found.size:
            raise SetupError(f"{module} has {found.size} bytes of parameters; found {len(block)}")
        parts = [self.packet(Code.STAGE, packing.pack(">HI", place, low) + block[low:high])
                 for low, high in _cuts(0, len(block))]
        return [*parts, self.packet(Code.COMMIT, packing.pack(">HH", place, binascii.crc_hqx(block, 0xFFFF)))]

    def change(self, module: str, before: bytes, after: bytes) -> list[bytes]:
        """What makes of a block, big-endian, another one, as a whole."""
        fields = self.dictionary.block(module)[1].fields
        changed = [(at, at + f.size) for _, f, at in leaves(fields) if before[at:at + f.size] != after[at:at + f.size]]
        if not changed:
            return []
        low, high = changed[0][0], changed[-1][1]
        return self.write_bytes(module, {low: after[low:high]}) if high - low <= DATA_MAX else self.load(module, after)

    def procedure(self, bytecode: bytes, turns: int = TURNS, slot: int = 0) -> list[bytes]:
        """Stage a procedure and start it. turns: of its loops and calls that it may take in one instant."""
        if not 0 < len(bytecode) <= PROCEDURE_MAX:
            raise SetupError(f"a procedure has 1 to {PROCEDURE_MAX} bytes of bytecode; found {len(bytecode)}")
        parts = [self.packet(Code.STAGE_PROCEDURE, packing.pack(">HI", slot, low) + bytecode[low:high])
                 for low, high in _cuts(0, len(bytecode))]
        crc = binascii.crc_hqx(bytecode, 0xFFFF)
        return [*parts, self.packet(Code.START_PROCEDURE, packing.pack(">HIHI", slot, len(bytecode), crc, turns))]

    def stop(self, slot: int = 0) -> bytes:
        """Stop the procedure of a slot."""
        return self.packet(Code.STOP_PROCEDURE, packing.pack(">H", slot))

    def evaluate(self, text: str, turns: int = TURNS) -> bytes:
        """Evaluate a text in flight, by a development build."""
        raw = text.encode()
        if not 0 < len(raw) <= DATA_MAX:
            raise SetupError(f"a text for flight has 1 to {DATA_MAX} bytes; found {len(raw)}")
        return self.packet(Code.EVALUATE, packing.pack(">HI", 0, turns) + raw)

    # --- stored commands (flight/services/stored_commands.h) ---

    def store(self, number: int, step: int, time: int, packet: bytes) -> bytes:
        """Store a command on board, as the step of a list, in place of one that is there. time [ns]: of list 0 that of
        its clock, of a sequence that since its start."""
        if not 0 <= number < LISTS or not 0 <= step < ALL or not 0 <= time < 2**63:
            raise SetupError(f"a stored command has a list from 0 to {LISTS - 1}, a step from 0 to {ALL - 1} and a "
                             f"time from 0 ns on; found {number}, {step}, {time} ns")
        if not 8 <= len(packet) <= STORED_MAX:
            raise SetupError(f"a stored command has 8 to {STORED_MAX} bytes; found {len(packet)}: write fewer "
                             "parameters at once")
        body = packing.pack(">HHq", number, step, time) + packet
        return self.packet(Code.STORE, binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "big") + body)

    def store_sequence(self, number: int, steps: Sequence[tuple[int, bytes]]) -> list[bytes]:
        """Store a block of commands as a list: (time since its start [ns], packet) of each."""
        return [self.store(number, i, t, packet) for i, (t, packet) in enumerate(steps)]

    def control(self, action: Action, number: int = ALL, stored: Sequence[Stored] | None = None) -> bytes:
        """Start, stop, hold, release, inhibit or allow a list, or all. stored: what a list that starts must be."""
        crc = binascii.crc_hqx(b"".join(packing.pack(">qHHHH", *one) for one in stored or []), 0xFFFF)
        return self.packet(Code.CONTROL, packing.pack(">HHH", number, action, crc if stored else 0))

    def delete(self, number: int = ALL, step: int = ALL) -> bytes:
        """Delete a stored command, a list, or all."""
        return self.packet(Code.DELETE, packing.pack(">HH", number, step))

    def stored(self, number: int) -> bytes:
        """Ask for what a list has: stored() reads the data of the report."""
        return self.packet(Code.LIST, packing.pack(">H", number))

    def monitor(self, place: int, number: str = "", **check: Any) -> bytes:
        """Write a monitor (flight/services/monitors.h), or turn it off by on=False alone.

        number: "flight.tracking.error.sigma_BR[2]" or, with the measure "norm" or "max_abs", all numbers of a field.
        It is right from low to high, where it equals a number, or, with bits, where none of the bits of that mask is
        set in a whole number of up to 32 bits; with change, its change from writing to writing is.
        hold [ns], count: how long, and at how many instants, it is wrong before the monitor fires. starts: a list.
        """
        return self._write_row("Monitors", "monitors", place, self._check(number, **check))

    def _check(self, number: str, *, on: bool = True, low: float | None = None, high: float | None = None,
               equals: float | None = None, bits: int | None = None, change: bool = False, measure: str = "",
               hold: int = 0, count: int = 0, starts: int = 0) -> dict[str, Any]:
        """The values of a Monitor."""
        if (low is not None or high is not None or change) + (equals is not None) + (bits is not None) > 1:
            raise SetupError("a monitor has either equals, or bits, or low and high")
        values: dict[str, Any] = dict.fromkeys(("output", "type", "offset", "n", "measure"), 0) | {"bits": bits or 0}
        if number:
            output, field, offset, n = self.dictionary.number(number, measure)
            if bits is not None:
                width = 0 if field.type not in ("i8", "u8", "i16", "u16", "i32",
                                                "u32") or measure else int(field.type[1:])
                if not width:
                    raise SetupError(f"{number}: bits are of one whole number of up to 32 bits, not of "
                                     + (f"its {measure}" if measure else f"{field.type}"))
                if not isinstance(bits, int) or not 0 < bits < 1 << width:
                    raise SetupError(f"{number} is a {field.type}: expected bits from 1 to {hex((1 << width) - 1)}; "
                                     f"found {bits!r}")
            values |= {"output": output, "type": NUMBERS.index(field.type), "offset": offset, "n": n,
                       "measure": ["", "norm", "max_abs"].index(measure)}
        elif on:
            raise SetupError("a monitor that is on needs a number")
        kind = 0 if not number else 4 if bits is not None else 3 if equals is not None else 2 if change else 1
        return values | {"kind": kind, "on": int(on), "hold": hold, "count": count, "list": starts,
                         "low": equals if equals is not None else -LARGEST if low is None else low,
                         "high": LARGEST if high is None else high}

    def rule(self, place: int, number: str = "", *, unit: int | None = None, becomes: str = "", mode: Any = None,
             limit: int = 0, **check: Any) -> bytes:
        """Write a rule of the fault protection (flight/services/fault_protection.h), or turn it off by on=False alone.

        number, check: as of a monitor. What follows where it stays wrong: a unit becomes something ("faulted", "off",
        "primary", "redundant"), a mode is requested, a list started; at most `limit` times, 0: always.
        """
        if becomes and unit is None:
            raise SetupError(f"a rule by which a unit becomes {becomes} has a unit")
        return self._write_row("FaultProtection", "rules", place, {
            "check": self._check(number, **check), "unit": 0 if unit is None else 1 + unit,
            "becomes": _unit_state(becomes) if becomes else 0, "mode": 0 if mode is None else 1 + self._mode(mode),
            "limit": limit})

    def unit(self, unit: int, state: str, even: bool = False) -> bytes:
        """Set the state of a unit (flight/services/fault_protection.h): "off", "primary", "redundant", "faulted".
        Flight refuses it where no unit of the kind would stay in use; even: it does not."""
        return self.packet(Code.UNIT, packing.pack(">HHH", unit, _unit_state(state), bool(even)))

    def clear_fault(self, unit: int | None = None) -> bytes:
        """Clear the fault of a unit, or of all, and what counts against the rules that accuse it."""
        return self.packet(Code.UNIT, packing.pack(">HHH", ALL if unit is None else unit, 0, 0))

    def events(self) -> bytes:
        """Ask for what the log of events has (flight/services/event_log.h), to be sent again."""
        return self.packet(Code.EVENTS)

    def filter_events(self, place: int, output: str = "", *, least: str = "info", most: int = 0, on: bool = True
                      ) -> bytes:
        """Write one of the filters of the log of events, or turn it off by on=False alone: of an output log what is at
        least so grave (info, low, medium, high, none), and at most so many in each window of time (0: all)."""
        known = [*SEVERITIES, "none"]
        values = {"on": int(on), "least": _place(known, known, least, "severity", "an event")[0] + 1, "most": most,
                  "output": self.dictionary.output(output)[0] if on else 0}
        return self._write_row("EventLog", "filters", place, values)

    def housekeeping(self, place: int, numbers: Sequence[str] = (), *, every: int = 0, on: bool = True) -> bytes:
        """Define a report of chosen numbers (flight/services/housekeeping.h) and turn it on; without numbers, turn the
        one that is defined on or off.

        numbers: "flight.motor.command.u[0]", or "flight.tracking.error.sigma_BR" with all of its numbers. every [ns].
        """
        path, rows, at = self._row("Housekeeping", "reports", place)
        if not numbers:
            one = next(f for f in rows.fields if f.name == "on")
            return self.write_bytes(path, {at + one.offset: encoded(one, int(on))})[0]
        if len(numbers) > CHOICES:
            raise SetupError(f"a report has up to {CHOICES} numbers or fields; found {len(numbers)}")
        choices = [dict(zip(("output", "type", "offset", "n"), (output, NUMBERS.index(field.type), offset, n)))
                   for output, field, offset, n in (self.dictionary.number(one, "any") for one in numbers)]
        none = dict.fromkeys(("output", "type", "offset", "n"), 0)
        packet = self._write_row("Housekeeping", "reports", place, {
            "period": every, "on": int(on), "n": len(choices), "choices": choices + [none] * (CHOICES - len(choices))})
        self.dictionary.learn(packet[HEADER:])
        return packet

    def _row(self, kind: str, name: str, place: int) -> tuple[str, Field, int]:
        """(path of the only module of a kind, its parameter, [bytes] up to an element of that)."""
        path, block = next(((b.path, b) for b in self.dictionary.blocks if b.type == kind), ("", None))
        if block is None:
            raise SetupError(f"{self.dictionary.name} has no module {kind}")
        rows = self._field(block, name)
        if not 0 <= place < rows.shape[0]:
            raise SetupError(f"{path} has the {name} 0 to {rows.shape[0] - 1}; found {place}")
        return path, rows, rows.offset + place * (rows.size // rows.shape[0])

    def _write_row(self, kind: str, name: str, place: int, values: dict[str, Any]) -> bytes:
        """Write an element of an array of structs; what is not given is 0."""
        path, rows, at = self._row(kind, name, place)
        raw = encoded(rows, dict.fromkeys((f.name for f in rows.fields), 0) | values, [])
        return self.write_bytes(path, {at: raw})[0]

    # --- files (flight/services/files.h) ---

    def send_file(self, name: str, to: str = "", unacknowledged: bool = False) -> bytes:
        """Send a file from on board to the ground, there under the same name or another one. unacknowledged: in CFDP's
        class 1, without repetition."""
        return self._named(Code.FILE_SEND, 1 if unacknowledged else 2, f"{name}>{to}" if to else name, 2)

    def control_file(self, action: FileAction, transaction: int, own: bool = True) -> bytes:
        """Suspend, resume or cancel a transaction. own: one that flight began, else the ground."""
        return self.packet(Code.FILE_CONTROL, packing.pack(">HHI", action, bool(own), transaction))

    def remove_file(self, name: str) -> bytes:
        """Remove a file on board."""
        return self._named(Code.FILE_REMOVE, 0, name)

    def load_table(self, module: str, name: str) -> bytes:
        """Let the parameters of a module become those of a file on board, which table() makes."""
        return self._named(Code.TABLE_LOAD, self.dictionary.block(module)[0], name)

    def dump_table(self, module: str, name: str) -> bytes:
        """Write the parameters of a module to a file on board, which read_table() reads."""
        return self._named(Code.TABLE_DUMP, self.dictionary.block(module)[0], name)

    def check(self, module: str) -> bytes:
        """Ask for the size and CRC of the parameters of a module: checked() reads the data of the report."""
        return self.packet(Code.CHECK, packing.pack(">H", self.dictionary.block(module)[0]))

    def _named(self, code, first, name, most=1):
        parts = [one.encode() for one in name.split(">")]
        if len(parts) > most or not all(0 < len(one) <= NAME_MAX and b"\0" not in one for one in parts):
            raise SetupError(f"a file on board has a name of 1 to {NAME_MAX} bytes without '>' and NUL; found '{name}'")
        return self.packet(code, packing.pack(">H", first) + name.encode())

    def _field(self, block, name):
        return _place(block.fields, [f.name for f in block.fields], name, "parameter", block.path)[1]


TABLE = ">4sHHIHxx"                      # the header of a table's file: magic, version, module, size, CRC
TABLE_MAGIC = b"FLTB"


def table(dictionary: Dictionary, module: str, block: bytes | None = None, **values: Any) -> bytes:
    """The file of a table for Packets.load_table(): the parameters of a module. values: those that differ from the
    big-endian block; without a block, all of them."""
    place, found = dictionary.block(module)
    if block is None:
        missing = [f.name for f in found.fields if f.name not in values and not f.name.startswith("spare")]
        if missing:
            raise SetupError(f"a table has all parameters of {module}: give {listed(missing)} too, or a block")
    elif len(block) != found.size:
        raise SetupError(f"{module} has {found.size} bytes of parameters; found {len(block)}")
    whole = bytearray(block or found.size)
    for name, value in values.items():
        field = _place(found.fields, [f.name for f in found.fields], name, "parameter", module)[1]
        whole[field.offset:field.offset + field.size] = encoded(field, value)
    return packing.pack(TABLE, TABLE_MAGIC, dictionary.version, place, len(whole),
                        binascii.crc_hqx(whole, 0xFFFF)) + whole


def read_table(dictionary: Dictionary, file: bytes) -> tuple[str, dict[str, Any]]:
    """(module, its parameters) of such a file, as Packets.dump_table() has it written. Raises SetupError."""
    head, block = file[:packing.calcsize(TABLE)], file[packing.calcsize(TABLE):]
    magic, version, place, size, crc = packing.unpack(TABLE, head.ljust(packing.calcsize(TABLE), b"\0"))
    if (magic, size, crc) != (TABLE_MAGIC, len(block), binascii.crc_hqx(block, 0xFFFF)):
        raise SetupError(f"the {len(file)} bytes are no table, or not a whole one")
    if version != dictionary.version or place >= len(dictionary.blocks) or size != dictionary.blocks[place].size:
        raise SetupError(f"the table is for version {version:#06x} of a dictionary; that of {dictionary.name} is "
                         f"{dictionary.version:#06x}")
    return dictionary.blocks[place].path, values(dictionary.blocks[place].fields, block)


def checked(data: bytes) -> tuple[int, int]:
    """(size [bytes], CRC-16-CCITT of the big-endian block) in the report of Code.CHECK."""
    size, crc = packing.unpack(">IH", data)
    return size, crc


def numbered(packet: bytes, sequence: int) -> bytes:
    """A space packet that is whole, with this sequence, and its length."""
    return packet[:2] + packing.pack(">HH", 0xC000 | sequence & 0x3FFF, len(packet) - 7) + packet[6:]


def checksummed(packet: bytes) -> bytes:
    """A command with its checksum: the XOR of all bytes is 0xFF."""
    return packet[:7] + bytes([reduce(xor, packet[:7] + packet[8:], 0xFF)]) + packet[8:]


def moved(packet: bytes, by: int) -> bytes:
    """The same command with a sequence that is `by` further. A wrong checksum stays wrong."""
    if len(packet) < 8:
        return packet
    raw, word = bytearray(packet), int.from_bytes(packet[2:4], "big")
    raw[2:4] = (word & 0xC000 | word + by & 0x3FFF).to_bytes(2, "big")
    raw[7] ^= reduce(xor, raw[2:4] + packet[2:4])
    return bytes(raw)


def encoded(field: Field, value: Any, shape: Sequence[int] | None = None) -> bytes:
    """A value in big-endian bytes."""
    shape = field.shape if shape is None else shape
    if field.type == "char" and shape:
        if len(shape) == 1 and isinstance(value, str):
            raw = value.encode()
            if len(raw) > shape[0]:
                raise SetupError(f"{field.name} has room for {shape[0]} bytes; '{value}' has {len(raw)}")
            return raw.ljust(shape[0], b"\0")
    if shape:
        if not hasattr(value, "__len__") or len(value) != shape[0]:
            raise SetupError(f"{field.name} has the shape {list(field.shape)}; found {value!r}")
        return b"".join(encoded(field, one, shape[1:]) for one in value)
    if field.type == "struct":
        missing = [f.name for f in field.fields if f.name not in value]
        if missing:
            raise SetupError(f"{field.name}: give {listed(missing)} too")
        return b"".join(encoded(f, value[f.name]) for f in field.fields)
    if field.type == "enum" and isinstance(value, str):
        short = short_names(field.enumerators)
        value = field.enumerators[value] if value in field.enumerators else _place(
            list(field.enumerators.values()), list(short.values()), value, "enumerator", field.name)[1]
    element = ELEMENTS[field.type]
    try:
        return packing.pack(">" + element.code, float(value) if element.is_float else int(value))
    except (packing.error, TypeError, ValueError, OverflowError) as error:
        raise SetupError(f"{field.name} is a {element.ctype}: {error}; found {value!r}") from None


def reversed_numbers(fields: Sequence[Any], content: bytes, start: int = 0) -> bytes:
    """The same numbers in the other byte order."""
    out = bytearray(content)
    for _, f, at in leaves(fields, -start):
        width = ELEMENTS[f.type].size
        for i in range(at, at + f.size, width):
            out[i:i + width] = content[i:i + width][::-1]
    return bytes(out)


# --- reports ---------------------------------------------------------------------------------------

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
        """Whether flight had the command itself."""
        return (self.stored_on, self.monitor, self.rule) != (None, None, None)

    @property
    def executed(self) -> bool:
        """Whether it is over: done, or refused at its execution."""
        return self.stage == Stage.DONE

    @property
    def stage_text(self) -> str:
        """What it says of a command that was not refused."""
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
    """(list, monitor, rule) of the member `from` of a CommandReport."""
    kinds = [(1, 32), (32, 48), (48, 80)]
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
    return sorted(Stored(int.from_bytes(one[16:24], "big"), int.from_bytes(one[14:16], "big"), len(one) - 24,
                         int.from_bytes(one[10:12], "big"), one[30]) for one in packets)


class Text(NamedTuple):
    """What an interpreter in flight says: a TelemetryText."""
    t: int                      # [ns] of flight
    kind: Kind
    sequence: int               # of the command that started the procedure or had the text
    line: int                   # of the script; 0: none
    text: str
    lost: int                   # texts before it, for which there was no room

    def __repr__(self) -> str:
        what = self.kind.name.lower().replace("_", " ")
        line = f", line {self.line}" if self.line else ""
        return f"<{what}{line}: {self.text!r}, t = {self.t / 1e9:g} s>"


class Event(NamedTuple):
    """What a module has said: an EventRecord of the log of events."""
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


class Choice(NamedTuple):
    """Numbers of a report of housekeeping."""
    path: str                   # flight.motor.command.u[0]
    field: Field | None         # None: the place has none
    shape: list[int]            # of what was chosen of it


class Selected(NamedTuple):
    """A report of housekeeping."""
    t: int                      # [ns]
    report: int                 # its place
    values: dict[str, Any] | None   # path -> value; None: what it has is not known here: Dictionary.learn()
    left_out: list[int]         # the places of choices that flight does not have
    data: bytes                 # the numbers, big-endian


# --- packets of telemetry --------------------------------------------------------------------------

HOUSEKEEPING_FIELDS = [("t", "q"), ("mode", "I"), ("staged", "I"), ("accepted", "I"), ("executed", "I"),
                       ("refused", "I")]
REPORT = "qHHHHHHH2x"               # CommandReport
TEXT = "qHHHHI4x"                   # TelemetryText
EVENT = ">qIIHHI4d"                 # EventRecord
SELECTED = ">q4H"                   # in front of a report's numbers


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


def _content(dictionary, stream, body, mark):
    """(content, path) of a packet."""
    content: Any
    place = stream - dictionary.telemetry
    if place == HOUSEKEEPING:
        numbers = packing.unpack_from(mark + "".join(code for _, code in HOUSEKEEPING_FIELDS), body)
        content = dict(zip([name for name, _ in HOUSEKEEPING_FIELDS], numbers))
        reasons = packing.unpack_from(f"{mark}{len(Reason)}I", body, 28)
        content["reasons"] = {Reason(i): n for i, n in enumerate(reasons) if n}
        begun, last = packing.unpack_from(f"{mark}2H", body, 28 + 4 * len(Reason))
        content["last"] = last if begun else None       # the sequence of the last command by the link from the ground
        path = "housekeeping"
    elif place == REPORTS:
        t, number, code, executed, reason, detail, n, origin = packing.unpack_from(mark + REPORT, body)
        content = Report(t, number, code, Stage(executed), Reason(reason), detail, body[24:24 + n],
                         *origins(origin))
        path = "reports"
    elif stream == dictionary.texts:
        t, kind, number, line, n, lost = packing.unpack_from(mark + TEXT, body)
        content = Text(t, Kind(kind), number, line, body[24:24 + n].decode(errors="replace"), lost)
        path = "texts"
    elif stream > dictionary.texts:
        path = SERVICES[stream - dictionary.texts - 1]
        content = {"events": _event, "selected": _selected}.get(path, lambda _, bytes_: bytes_)(dictionary, body)
    else:
        output = dictionary.outputs[place - OUTPUTS]
        if len(body) != output.size:
            raise SetupError(f"{output.path} has {output.size} bytes; the packet has {len(body)}")
        content, path = values(output.fields, body, mark), output.path
    return content, path


def _event(dictionary, body):
    t, number, before, place, severity, kind, *arguments = packing.unpack(EVENT, body)
    output = dictionary.outputs[place] if place < len(dictionary.outputs) else None
    unknown = EventId(kind, f"event {kind}", "", tuple((f"argument {i}", "-") for i in range(4)), "")
    said = next((one for one in output.events if one.id == kind), unknown) if output else unknown
    return Event(t, output.path if output else f"output {place}", said.name,
                 dict(enumerate(SEVERITIES, 1)).get(severity, str(severity)),
                 dict(zip((name for name, _ in said.arguments), arguments)), number, before, said.text(arguments))


def _selected(dictionary, body):
    t, report, crc, left_out, n = packing.unpack_from(SELECTED, body)
    data, at, found = body[16:16 + n], 0, {}
    for i, one in enumerate(dictionary.choices.get(crc, [])):
        if not left_out >> i & 1 and one.field:
            end = at + ELEMENTS[one.field.type].size * math.prod(one.shape)
            found[one.path] = _value(one.field, data[at:end], one.shape, ">")
            at = end
    return Selected(t, report, found if crc in dictionary.choices else None,
                    [i for i in range(CHOICES) if left_out >> i & 1], data)


def values(fields: Sequence[Field], raw: bytes, mark: str = ">") -> dict[str, Any]:
    """Field -> value of a block or message: numbers, texts, enumerators by name, lists, dicts. mark: ">" big-endian."""
    return {f.name: _value(f, raw[f.offset:f.offset + f.size], f.shape, mark) for f in fields}


class Enumerator(str):
    """The whole name of an enumerator, as databases of ground stations have it; its short name equals it, too."""

    short: str

    def __new__(cls, whole: str, short: str) -> Enumerator:
        one = super().__new__(cls, whole)
        one.short = short
        return one

    def __eq__(self, other: object) -> bool:
        return str.__eq__(self, other) is True or other == self.short

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = str.__hash__


def _value(field, raw, shape, mark):
    if field.type == "char" and len(shape) == 1:
        return raw.rstrip(b"\0").decode(errors="replace")
    if shape:
        size = len(raw) // shape[0]
        return [_value(field, raw[i * size:(i + 1) * size], shape[1:], mark) for i in range(shape[0])]
    if field.type == "struct":
        return values(field.fields, raw, mark)
    value = packing.unpack(mark + ELEMENTS[field.type].code, raw)[0]
    if field.type == "enum":
        return next((Enumerator(name, short) for name, short in short_names(field.enumerators).items()
                     if field.enumerators[name] == value), value)
    return value


# --- packets in files ------------------------------------------------------------------------------

class Timed(NamedTuple):
    """A command that flight gets before its first instant after a time, or a packet of telemetry and its instant."""
    t: int                      # [ns]
    packet: bytes


def sequence_of(packet: bytes) -> int:
    """The number that the report of a command has."""
    return int.from_bytes(packet[2:4], "big") & 0x3FFF


def script(packets: Iterable[Timed]) -> str:
    """The lines of a file of packets, for --script of fledge_board_node."""
    return "".join(f"{one.t} {one.packet.hex()}\n" for one in packets)


def read_script(text: str) -> list[Timed]:
    """The packets of such a file."""
    return [Timed(int(t), bytes.fromhex(digits)) for t, digits in (line.split() for line in text.splitlines())]

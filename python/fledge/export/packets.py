# SPDX-License-Identifier: Apache-2.0
"""All packets and commands of a flight process, bit by bit: what its database (xtce.py) and its page (page.py) show.

Names and places are those of flight/command/command.h and flight/telemetry/telemetry.h, and of the modules' headers.
"""
from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field as with_default, replace
from typing import TYPE_CHECKING, Any

from fledge.commands import (ALL, ARGUMENTS, DATA_MAX, HOUSEKEEPING, NAMED, REPORTS, SERVICES, TURNS, UNIT_STATES, WHY,
                             Action, Code, FileAction, Kind, Reason, Stage, leaves, parameters)
from fledge.commands.protocol import (EVENT_RECORD, HOUSEKEEPING_RECORD, REPORT_RECORD, SERVICE_OF, TEXT_RECORD,
                                      argument_type)
from fledge.elements import ELEMENTS
from fledge.export.commands import dictionary
from fledge.export.read import ExportError
from introspect.comment import SEVERITIES

if TYPE_CHECKING:
    from enum import IntEnum

    from fledge.commands import Dictionary
    from fledge.export.read import Mission, Module


@dataclass(frozen=True)
class Item:
    """A number, text or run of bytes in a packet."""
    name: str                   # omega_BN_B[0]; in its packet, no other has it
    type: str                   # f64, ..., u64, enum; char: a text; bytes
    bits: int                   # 0: it has 8 times the number in the item `count`, and ends the packet
    meaning: str = ""
    unit: str = ""
    enumerators: Mapping[str, int] = with_default(default_factory=dict)     # label -> number
    bounds: tuple = (None, None, False, False)          # (low, high, whether low is excluded, high)
    rule: str = ""                                      # of a parameter, as its header says it
    value: int | None = None                            # of a command: what is in it, unless the ground changes it
    count: str = ""


@dataclass(frozen=True)
class Packet:
    """A packet of telemetry. Its header is in front: HEADER."""
    path: str                   # flight.control.torque, flight.housekeeping
    about: str
    stream: int
    items: Sequence[Item]       # behind those of its parent
    order: str = ""             # of its numbers; "": as the others
    parent: str = ""            # flight.events: it is one of those, by `fixed`
    fixed: Mapping[str, int] = with_default(default_factory=dict)   # numbers of its parent's items
    rest: Sequence[Item] = ()   # of a parent: what it ends with, which its children say better


@dataclass(frozen=True)
class Command:
    """A command. One that only others are made from is abstract; they begin as it does."""
    path: str                   # flight.mode; flight.write.control.K writes this parameter
    about: str
    items: Sequence[Item]       # behind those of its parent
    parent: str = ""
    fixed: Mapping[str, int] = with_default(default_factory=dict)   # numbers of its parents' items
    abstract: bool = False


@dataclass(frozen=True)
class Database:
    """All that a flight process sends and understands."""
    process: str                # flight
    dictionary: Dictionary
    packets: Sequence[Packet]
    commands: Sequence[Command]

    @property
    def order(self) -> str:
        """Of the numbers behind the header of telemetry: "big" or "little"."""
        return self.dictionary.order

    def command(self, path: str) -> Command:
        return next(command for command in self.commands if command.path == path)

    def chain(self, command: Command) -> list[Command]:
        """Its parents from the first on, and itself."""
        return [*(self.chain(self.command(command.parent)) if command.parent else []), command]


def bits(name: str, n: int, meaning: str = "", value: int | None = None, unit: str = "") -> Item:
    return Item(name, next(f"u{size}" for size in (8, 16, 32, 64) if n <= size), n, meaning, unit, value=value)


def number(name: str, type_: str, meaning: str = "", unit: str = "", enumerators: Mapping[str, int] | None = None,
           value: int | None = None) -> Item:
    return Item(name, type_, 8 * ELEMENTS[type_].size, meaning, unit, enumerators or {}, value=value)


def primary(command: bool, stream: int) -> list[Item]:
    """The primary header of a space packet."""
    return [bits("ccsds_version", 3, value=0), bits("ccsds_type", 1, "0 telemetry, 1 command", value=int(command)),
            bits("ccsds_secondary", 1, "1: a secondary header follows", value=1),
            bits("ccsds_apid", 11, "which stream", value=stream & 0x7FF),
            bits("ccsds_segmentation", 2, "3: a whole packet", value=3),
            bits("ccsds_sequence", 14, "counts the packets of the stream", value=0),
            bits("ccsds_length", 16, "bytes of the packet, less 7", value=0)]


HEADER = [*(replace(item, value=None) for item in primary(False, 0)), bits("header_seconds", 32, "flight's time",
          unit="s"), bits("header_fraction", 16, "of a second, in 1/65536"), bits("header_spare", 32)]


def database(mission: Mission, facts: Dictionary | None = None, last: Packet | None = None) -> Database:
    """Of a flight process. facts: its dictionary, of the streams and byte order where it flies; None: those of its own
    board. last: what the stream behind those of the outputs has; None: texts."""
    facts = facts or dictionary(mission)
    return Database(mission.process, facts, [*packets(mission, facts), last or texts(mission, facts),
                                             *services(mission, facts)], list(commands(mission, facts)))


# --- telemetry -------------------------------------------------------------------------------------

def packets(mission: Mission, facts: Dictionary) -> Iterator[Packet]:
    yield housekeeping(mission, facts)
    yield reports(mission, facts)
    for output, message in zip(facts.outputs, mission.outputs):
        fields = list(numbers(message.struct.fields))
        if output.path != message.path or sum(field.bits for field in fields) != 8 * output.size:
            raise ExportError(f"{output.path}: its packet has {output.size} bytes, its fields have not")
        yield Packet(output.path, first_words(message.struct.doc), output.stream, fields)


def record(numbers_: Iterable[tuple[str, str, int]], about: Mapping[str, Any]) -> list[Item]:
    """The numbers of a record. about: of its names, what the database says: a meaning, or changes of an Item; of an
    array, these for each of its elements, by its name."""
    items = []
    for name, type_, n in numbers_:
        of = about.get(name, "")
        for own, meaning in of.items() if n > 1 else [(name, of)]:
            items.append(replace(number(own, type_), **
                         (meaning if isinstance(meaning, dict) else {"meaning": meaning})))
    return items


def housekeeping(mission: Mission, facts: Dictionary) -> Packet:
    modules = {"none": 0} | {block.path: 1 + i for i, block in enumerate(facts.blocks)}
    items = record(HOUSEKEEPING_RECORD, {
        "t": {"meaning": "flight's instant", "unit": "ns"},
        "mode": {"meaning": "the active mode", "enumerators": numbered(facts.modes)},
        "staged": {"meaning": "the module that is staged", "enumerators": modules},
        **{name: f"commands {name}" for name in ("accepted", "executed", "refused")},
        "reasons": {f"reasons.{reason.name.lower()}": f"refused: {WHY[reason]}" if reason in WHY else "always 0"
                    for reason in Reason},
        "begun": "1: a command came by the link from the ground",
        "last": "the sequence of the last one that was accepted"})
    return Packet(f"{mission.process}.housekeeping", "the state of flight", facts.telemetry + HOUSEKEEPING, items)


def reports(mission: Mission, facts: Dictionary) -> Packet:
    items = record(REPORT_RECORD, {
        "t": {"meaning": "the instant of execution; of acceptance, the last instant before; -1: none", "unit": "ns"},
        "sequence": "of the command", "code": {"meaning": "what the command is", "enumerators": lower(Code)},
        "executed": {"meaning": "what this is about", "enumerators": lower(Stage)},
        "reason": {"meaning": "ok, or why it was refused", "enumerators": lower(Reason)},
        "detail": "of a rule: its place in the module's list; of a sequence: the last accepted; under way: percent; of "
                  "a file that failed: CFDP's condition",
        "n": "bytes read back",
        "origin": {"name": "from", "meaning": "1: list 0 of stored commands, and so on; 32: monitor 0, and so on; 48: "
                   "rule 0 of the fault protection, and so on; 0: from elsewhere"}})
    items.append(Item("data", "bytes", 0, "parameters read back, each number big-endian", count="n"))
    return Packet(f"{mission.process}.reports", "what was done with a command, and what was read back",
                  facts.telemetry + REPORTS, items)


def texts(mission: Mission, facts: Dictionary) -> Packet:
    items = record(TEXT_RECORD, {
        "t": {"meaning": "flight's instant", "unit": "ns"}, "kind": {"enumerators": lower(Kind)},
        "sequence": "of the command that started the procedure or had the text", "line": "of the script; 0: none",
        "n": "letters", "lost": "texts before it, for which there was no room"})
    items.append(Item("text", "char", 0, count="n"))
    return Packet(f"{mission.process}.texts", "what an interpreter in flight says", facts.texts, items)


def services(mission: Mission, facts: Dictionary) -> Iterator[Packet]:
    """What services send. It is big-endian everywhere."""
    types = {module.type for module in mission.modules}
    if "EventLog" in types:
        path, stream = f"{mission.process}.events", facts.texts + 1 + SERVICES.index("events")
        *head, arguments = EVENT_RECORD
        rest = {f"arguments[{i}]": "as its id says" for i in range(arguments[2])}
        yield Packet(path, "what a module has said", stream, record(head, {
            "t": {"meaning": "of the event", "unit": "ns"}, "number": "counts the events of the log",
            "before": "events of the output before it that were not logged",
            "output": "whose event it is: the place in the list of outputs",
            "severity": {"meaning": "how grave it is", "enumerators": numbered(["none", *SEVERITIES])},
            "id": "which event of the output"}), "big", rest=record([arguments], {"arguments": rest}))
        for place, output in enumerate(facts.outputs):
            for event in output.events:
                own = [number(name, "f64", unit="" if unit in ("-", "SI") else unit) for name, unit in event.arguments]
                spare = [replace(bits("spare", 64), name=f"spare{i}") for i in range(len(own), len(rest))]
                yield Packet(f"{output.path}.{event.name}", f"{event.meaning} ({event.severity})", stream,
                             [*own, *spare],
                             "big", path, {"output": place, "id": event.id})
    if "Housekeeping" in types:
        items = [
            number("t", "i64", "flight's instant", "ns"), number("report", "u16", "which"),
            number("crc", "u16", "CRC-16-CCITT of its choices: each output, offset, type, n"),
            number("left_out", "u16", "bit i: choice i names no number"), number("n", "u16", "bytes of the numbers"),
            Item("numbers", "bytes", 0, "each in its own type; commands define which", count="n")]
        yield Packet(f"{mission.process}.selected", "numbers that the ground has chosen: a report of housekeeping",
                     facts.texts + 1 + SERVICES.index("selected"), items, "big")
    if "Files" in types:
        yield Packet(f"{mission.process}.files", "a PDU of CFDP (727.0-B-5)",
                     facts.texts + 1 + SERVICES.index("files"), list(pdu()), "big")


def pdu() -> Iterator[Item]:
    """A PDU of files, with numbers of entities and transactions as wide as flight has them."""
    yield bits("pdu_version", 3, "always 1")
    for name, labels in {"pdu_type": ["directive", "file_data"], "direction": ["to_receiver", "to_sender"],
                         "mode": ["acknowledged", "unacknowledged"], "crc": ["none", "at_the_end"],
                         "large": ["places_of_32_bits", "places_of_64_bits"]}.items():
        yield replace(bits(name, 1), enumerators=numbered(labels))
    yield from [
        number("n", "u16", "bytes of data"), bits("boundaries", 1, "1: of records, which files here have not"),
        bits("entity_width", 3, "bytes of an entity's number, less 1: here 1"),
        bits("metadata", 1, "1: of the segment is in front of its data"),
        bits("sequence_width", 3, "bytes of a transaction's number, less 1: here 3"),
        number("source", "u16", "the entity that sends the file"), number("transaction", "u32", "its number"),
        number("destination", "u16", "the entity that gets the file"),
        Item("data", "bytes", 0, "of a directive: its code and content; of file data: its place in the file, and the "
             "bytes", count="n")]


def numbered(names: Sequence[str]) -> dict[str, int]:
    return {name: i for i, name in enumerate(names)}


def lower(kind: type[IntEnum]) -> dict[str, int]:
    return {member.name.lower(): int(member) for member in kind}


def first_words(doc: str) -> str:
    """The first sentence of a comment."""
    text = " ".join(doc.split())
    return text.partition(". ")[0].rstrip(".")


def numbers(fields: Sequence[Any]) -> Iterator[Item]:
    """Each number and text of a message or of parameters, in the order of memory, which has no gaps."""
    for path, f, _ in leaves(fields):
        shape, width = list(f.shape), ELEMENTS[f.type].size
        if f.type == "char" and shape:
            width *= shape.pop()
        rule = f.rule.removeprefix("required").removeprefix(", ")
        for index in itertools.product(*map(range, shape)):
            yield Item(path + "".join(f"[{i}]" for i in index), f.type, 8 * width, f.doc,
                       "" if f.unit == "-" else f.unit, dict(f.enumerators) if f.type == "enum" else {},
                       tuple(f.bounds), rule)


# --- commands --------------------------------------------------------------------------------------

ABOUT = {
    Code.NOOP: "no operation", Code.RESET_COUNTERS: "set the counters of commands to zero", Code.MODE: "request a mode",
    Code.WRITE: "write parameters", Code.STAGE: "stage a part of a block of parameters",
    Code.COMMIT: "let the staged block count", Code.PUBLISH: "publish a module of the configuration",
    Code.RESET_FLIGHT: "flight begins again; its parameters stay", Code.ARM: "arm or disarm an event",
    Code.READ: "read parameters back: the report of the execution has them",
    Code.TELEMETRY: "send an output, or do not", Code.STAGE_PROCEDURE: "stage a part of a procedure",
    Code.START_PROCEDURE: "start the procedure of a slot", Code.STOP_PROCEDURE: "stop the procedure of a slot",
    Code.EVALUATE: "evaluate a line of text in flight", Code.STORE: "store a command until its time",
    Code.DELETE: "delete stored commands", Code.CONTROL: "control lists of stored commands",
    Code.LIST: "report a list of stored commands: the report of the execution has them",
    Code.PDU: "a PDU of the file delivery protocol", Code.FILE_SEND: "send a file to the ground",
    Code.FILE_CONTROL: "control a transaction of files", Code.FILE_REMOVE: "remove a file on board",
    Code.TABLE_LOAD: "let the parameters of a module become those of a file on board",
    Code.TABLE_DUMP: "write the parameters of a module to a file on board",
    Code.CHECK: "size and CRC of parameters: the report of the execution has them",
    Code.EVENTS: "send again what the log of events has",
    Code.UNIT: "set the state of a unit of the spacecraft, or clear its fault"}


def commands(mission: Mission, facts: Dictionary) -> Iterator[Command]:
    process = mission.process
    header, plain = f"{process}.command", f"{process}.plain"
    yield Command(plain, "the header of a command", [
        *primary(True, facts.stream), bits("code", 8, "what the command is"),
        bits("checksum", 8, "the XOR of all bytes of the packet is 0xFF", value=0)], abstract=True)
    yield Command(header, "the header of a command for this version of the mission",
                  [bits("version", 16, "of the mission's dictionary", value=facts.version)], plain, abstract=True)
    blocks = {block.path: i for i, block in enumerate(facts.blocks)}
    choices: dict[str, dict[str, int]] = {
        "mode": numbered(facts.modes), "event": numbered(facts.events), "module": blocks,
        "output": {output.path: i for i, output in enumerate(facts.outputs)}
        | {f"{process}.housekeeping": len(facts.outputs), "all": ALL}, "on": {"off": 0, "on": 1},
        "action": lower(Action), "file_action": lower(FileAction), "own": {"ground": 0, "flight": 1},
        "class": {"unacknowledged": 1, "acknowledged": 2}, "even": {"refuse": 0, "even": 1},
        "state": {"clear": 0} | {name: 1 + i for i, name in enumerate(UNIT_STATES)}}
    types = {module.type for module in mission.modules}
    published = {block.path: blocks[block.path] for block in facts.blocks if block.configuration}
    for code in Code:
        of = {**choices, "module": published if code == Code.PUBLISH else blocks}
        names = [name for name in ARGUMENTS[code] if name != "version"]
        there = SERVICE_OF.get(code, "") in {"", *types}
        if code != Code.WRITE and there and all(of.get(name, True) for name in names):
            parent = header if "version" in ARGUMENTS[code] else plain
            about = ABOUT.get(code, "") + "".join(
                f"; {mode} is entered only {guard}" for mode, guard in facts.guards.items() if code == Code.MODE)
            yield Command(f"{process}.{code.name.lower()}", about,
                          [item for name in names for item in argument(code, name, of.get(name, {}))], parent,
                          {"code": int(code)})
    write = f"{process}.write"
    yield Command(write, ABOUT[Code.WRITE], [number("module", "u16"), number("offset", "u32", "in its parameters")],
                  header, {"code": int(Code.WRITE)}, abstract=True)
    for module in mission.modules:
        yield from writes(module, write, blocks.get(module.path, 0))


def argument(code: Code, name: str, choices: Mapping[str, int]) -> Iterator[Item]:
    """An argument of a command, by its name in ARGUMENTS."""
    if name == "bytes":
        meaning = "text" if code == Code.EVALUATE else "its name, or NAME>NAME for the ground" \
            if code == Code.FILE_SEND else "its name" if code in NAMED else ""
        yield Item("bytes", "char" if meaning else "bytes", 0, meaning, count="n")
        return
    values = {"zero": 0, "turns": TURNS, "every": 1, "on": 1}
    item = number(name, argument_type(name), MEANINGS.get(name, ""), "ns" if name == "time" else "",
                  choices, values.get(name))
    yield replace(item, bounds=LIMITS.get(name, item.bounds))


MEANINGS = {"crc": "CRC-16-CCITT of what was staged, or is to be stored or started", "n": "how many bytes",
            "every": "how many writings", "offset": "of the first byte",
            "turns": "of its loops and calls in one instant", "length": "how many bytes",
            "slot": "where the procedure lies", "list": "0: absolute times; 1 to 15: a sequence; 65535: all",
            "own": "who began it", "transaction": "its number", "class": "of CFDP",
            "unit": "its place; 65535: all", "state": "of the unit; clear: its fault, of all units too",
            "even": "whether to refuse it where none of its kind would stay in use", "step": "of the list; 65535: all",
            "time": "absolute, or since the start of the sequence"}
LIMITS = {"zero": (0, 0, False, False), "every": (1, None, False, False), "turns": (1, None, False, False),
          "n": (1, DATA_MAX, False, False), "length": (1, None, False, False),
          "time": (0, None, False, False)}


# Of the parameters of services: the store, which Code.STORE writes; choices, for a report is defined whole; units and
# what rules are, for they are tables.
UNWRITTEN = {"StoredCommands": ["commands["], "Housekeeping": [".choices["], "FaultProtection": [
    "units[", ".unit", ".becomes", ".mode", *(f".check.{name}" for name in (
        "low", "high", "hold", "count", "kind", "output", "offset", "type", "n", "measure", "list", "bits"))]}


def writes(module: Module, parent: str, place: int) -> Iterator[Command]:
    """Commands that write the parameters of a module: one for each, or for each struct of an array, or more where it is
    longer than a command."""
    process, _, name = module.path.partition(".")
    fields, start, _ = parameters(module.struct)
    for path, f, at in leaves(fields, -start):
        if f.name.startswith("spare") or any(unwritten in path for unwritten in UNWRITTEN.get(module.type, ())):
            continue
        items = list(numbers([f]))
        size = f.size // len(items)
        most = max(1, DATA_MAX // size)
        for first in range(0, len(items), most):
            part = items[first:first + most]
            end = f".from_{first}" if len(items) > most else ""
            yield Command(f"{process}.write.{name}.{path}{end}", f"write {f.doc or path}", part, parent,
                          {"module": place, "offset": at + first * size})

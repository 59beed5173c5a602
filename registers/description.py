# SPDX-License-Identifier: Apache-2.0
"""The description of boards: reads and checks their TOML files, and lays out every lane.

README.md lists the keys. One reading finds all mistakes, each with file, line, rule, finding and advice.
"""
from __future__ import annotations

import dataclasses
import itertools
import os.path
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any
from pathlib import Path

from introspect.files import fnv1a
from introspect.keywords import C, CPP
from registers import checked_toml
from registers.checked_toml import Tables, TomlError, shown
from registers.location import line_of

CONTROL_SIZE = 32      # registers/lane.h
SLOT_HEAD = 8
CLOCK_SIZE = 32        # registers/clock.h
SLAVE_SIZE = 48
INTERRUPT_SIZE = 8
CDR_HEAD = 4           # registers/message.h
SINGLE_SLOTS = 4
STEP = 0x20            # what has no address begins at a multiple of this

ORDERS = ("big", "little")
FORMS = ("word", "packet", "message")
DIRECTIONS = ("read", "write", "both")
OVERFLOWS = ("refuse", "overwrite")
UNITS = (1, 2, 4, 8)

_BOARD_KEYS = ("name", "doc", "base", "size", "order", "clock", "slave_clock", "interrupts", "snorkel",
               "bound")
_SLAVE_KEYS = ("address", "interrupt", "start", "drift", "slew", "pulse")
_BOUND_KEYS = ("field", "at_most", "after", "scenario")
NUMBERS = {"f64": (64, True, True), "f32": (32, True, True),      # bits, signed, floating
           **{f"{kind}{bits}": (bits, kind == "i", False) for kind in "iu" for bits in (8, 16, 32, 64)}}
SEES = ("oldest", "newest")

_OF_LANE = ("address", "interrupt", "descriptor", "remove", "add", "carries", "field")
_SNORKEL_KEYS = ("name", "doc", "form", "direction", *_OF_LANE, *[f"write_{k}" for k in _OF_LANE],
                 "count", "queue", "overflow", "sees", "size", "capacity", "unit", "outside_order",
                 "message", "header")
_ONLY_FOR = {          # keys that only these forms have
    "count": ("word",), "field": ("word", "packet"), "write_field": ("word", "packet"),
    "capacity": ("packet", "message"), "size": ("packet", "message"),
    "descriptor": ("packet", "message"), "write_descriptor": ("packet", "message"),
    "remove": ("packet",), "add": ("packet",),
    "write_remove": ("packet",), "write_add": ("packet",),
    "unit": ("packet",), "outside_order": ("packet",),
    "message": ("message",), "header": ("message",), "carries": ("message", "packet"),
    "write_carries": ("message", "packet"),
}
_FIELD_KEYS = ("name", "doc", "bits", "signed", "scale", "offset", "unit", "carries")
_PACKET_FIELD_KEYS = ("name", "doc", "at", "type", "order", "count", "tag", "scale", "offset", "unit", "carries")
_DESCRIPTOR_KEYS = ("address", "length", "tag", "valid")

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
_TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_KEYWORDS = C | CPP


@dataclass(frozen=True)
class Number:
    """A number of a mission's message, or `count` equal ones in a row."""
    path: str       # "world.power.telemetry.cards[0].current"
    type: str       # "u16"
    count: int
    unit: str
    doc: str


# What a path carries: the numbers of a message or of a part of it, in their order; None: something else, such as
# "commands". Raises LookupError if there is no such path.
Carried = Callable[[str], "list[Number] | None"]


@dataclass(frozen=True)
class Field:
    """A part of a word, or numbers in a packet: value = offset + scale * count."""
    name: str
    doc: str
    lsb: int
    bits: int
    signed: bool
    scale: float
    offset: float
    unit: str
    carries: str | None = None      # the number of a mission's message that it carries, or the first of `count`
    line: int = field(default=0, compare=False, repr=False)   # of `carries` in the file
    # Of packets only, whose numbers are whole bytes:
    at: int = 0                     # [bytes] from the beginning of flight's packet
    type: str | None = None         # "f32"
    order: str = "big"
    count: int = 1                  # numbers in a row
    tag: int = 0                    # the kind of packet, as its descriptor has it

    @property
    def end(self) -> int:
        """[bytes] behind its last number in the packet."""
        return self.at + self.count * self.bits // 8

    @property
    def low(self) -> int:
        return -(1 << self.bits - 1) if self.signed else 0

    @property
    def high(self) -> int:
        return self.low + (1 << self.bits) - 1


@dataclass(frozen=True)
class Descriptor:
    """The parts of a describing word, as (lowest bit, number of bits). 0 bits: the part is not there."""
    address: int | None = None      # of the ring; None: in the slots
    length: tuple[int, int] = (0, 24)
    tag: tuple[int, int] = (24, 7)
    valid: tuple[int, int] = (31, 1)


@dataclass(frozen=True)
class Lane:
    """One direction of a snorkel. Addresses and sizes in bytes."""
    name: str           # the snorkel's, followed by `_read` or `_write` if it has both directions
    from_flight: bool
    form: str
    address: int
    size: int           # of the whole lane
    capacity: int
    stride: int
    depth: int
    queued: bool
    variable: bool
    overwrite: bool
    count: int
    interrupt: str | None
    descriptor: Descriptor
    remove: int
    add: tuple[int, ...]
    unit: int
    swap: bool
    newest: bool                        # of a queue, a reader of numbers sees the newest; else the oldest
    fields: tuple[Field, ...]
    carries: str | None                 # a mission's message
    line: int = field(default=0, compare=False, repr=False)     # of `carries` in the file


@dataclass(frozen=True)
class Snorkel:
    name: str
    doc: str
    direction: str
    lanes: tuple[Lane, ...]
    message: str | None
    header: str | None
    message_size: int | None

    @property
    def carries(self) -> str | None:
        """What its first lane carries whole."""
        return self.lanes[0].carries

    @property
    def line(self) -> int:
        return self.lanes[0].line

    @property
    def fields(self) -> tuple[Field, ...]:
        """Of all lanes, each once."""
        return tuple(dict.fromkeys(field for lane in self.lanes for field in lane.fields))


@dataclass(frozen=True)
class Slave:
    """A clock of its own rate. Times in ns, rates in ns per second."""
    address: int
    interrupt: str | None
    start: int
    drift: int
    slew: int
    pulse: int


@dataclass(frozen=True)
class Bound:
    """How much a number that flight puts out may differ, through this board, from one whose messages pass whole."""
    field: str              # "flight.tracking.error.sigma_BR"
    at_most: float
    after: float            # [s] from when on
    scenario: str | None    # None: all
    line: int = dataclasses.field(default=0, compare=False, repr=False)


@dataclass(frozen=True)
class Board:
    name: str
    doc: str
    base: int
    size: int
    order: str
    clock: int | None
    clock_interrupt: str | None
    interrupts: int | None
    lines: tuple[str, ...]
    level: int                          # the processor's interrupt that its lines raise; 0: the machine's file says it
    snorkels: tuple[Snorkel, ...]
    path: Path = field(compare=False)
    bounds: tuple[Bound, ...] = field(default=(), compare=False)
    slave: Slave | None = None

    @property
    def file(self) -> str:
        """Without folder."""
        return self.path.name

    @property
    def lanes(self) -> list[Lane]:
        return [lane for snorkel in self.snorkels for lane in snorkel.lanes]

    @property
    def hash(self) -> int:
        """The 64-bit FNV-1a of everything that both sides must agree on."""
        return fnv1a(repr((self.name, self.size, self.order, self.clock, self.slave, self.interrupts, self.lines,
                           [(lane, s.message) for s in self.snorkels for lane in s.lanes])))


def read(path: Path) -> Board:
    """The board of a file; TomlError with all complaints if there are any."""
    return parse(checked_toml.text_of(path), path)


def parse(text: str, path: Path, carried: Carried | None = None) -> Board:
    """The same as read(), from the text of the file. carried: of the mission whose numbers pass in packets."""
    data, lines = checked_toml.parse(text, path)
    reader = _Reader(str(path), lines, carried)
    board = reader.board(data, path)
    if reader.problems:
        raise TomlError(reader.complaints())
    return board


def files_of(paths: Iterable[Path | str]) -> list[Path]:
    """The files of boards: those that are named, and all *.toml of the folders that are, by name. Raises TomlError for
    a folder without any."""
    files: list[Path] = []
    for path in map(Path, paths):
        inside = sorted(path.glob("*.toml")) if path.is_dir() else [path]
        if not inside:
            raise TomlError(f"{path}: the folder of boards has no file *.toml")
        files += inside
    return files


def read_all(paths: Iterable[Path | str], carried: Carried | None = None) -> list[Board]:
    """The boards of files and folders. Raises TomlError with all complaints, OSError."""
    return parse_all([(path, checked_toml.text_of(path)) for path in files_of(paths)], carried)


def parse_all(texts: Iterable[tuple[Path, str]], carried: Carried | None = None) -> list[Board]:
    """The same from (path, text) pairs. Raises TomlError with all complaints."""
    boards: list[Board] = []
    wrong = []
    for path, text in texts:
        try:
            board = parse(text, path, carried)
        except TomlError as error:
            wrong.append(str(error))
            continue
        for other in boards:
            if board.name == other.name:
                wrong.append(f"{path}:1: boards' names differ; `{board.name}` is also {other.path}'s; rename one")
            elif board.base < other.base + other.size and other.base < board.base + board.size:
                wrong.append(f"{path}:1: boards do not overlap; {board.name} [{board.base:#x}, "
                             f"{board.base + board.size:#x}) overlaps {other.name} [{other.base:#x}, "
                             f"{other.base + other.size:#x}) of {other.path}; move one")
        boards.append(board)
    if wrong:
        raise TomlError("\n".join(wrong))
    return boards


class _Reader(Tables):
    """Reads the tables of a board, and collects the addresses and interrupt lines that they use."""

    whole = "#x"

    def __init__(self, file: str, lines: dict, carried: Carried | None):
        super().__init__(file, lines)
        self.carried = carried
        self.taken: list[tuple[int, int, str, tuple]] = []    # address, end, what it is, path
        self.raised: dict[str, tuple[bool, str]] = {}         # line: whether flight raises it, what raises it

    def name(self, table: dict, path: tuple, used: dict, what: str) -> str:
        name = self.text(table, path, "name")
        if "name" not in table:
            return "?"
        if not _NAME.fullmatch(name) or name in _KEYWORDS:
            self.refuse((*path, "name"), "a name is lower case with single _ and no keyword",
                        f"it is {shown(name)}", "write for example \"sun_sensor_2\"")
        elif name in used:
            self.refuse((*path, "name"), f"{what} names differ", f"`{name}` stands in line "
                        f"{line_of(self.lines, used[name])} too", "rename one")
        used.setdefault(name, (*path, "name"))
        return name

    # ---- the board

    def board(self, data: dict, file: Path) -> Board:
        self.keys(data, (), _BOARD_KEYS)
        name = self.name(data, (), {}, "board")
        base = self.integer(data, (), "base", 0, 0xFFFFFFF8, multiple=8) or 0
        size = self.integer(data, (), "size", 8, 0x10000000, None, multiple=8)
        order = self.choice(data, (), "order", ORDERS, "big") or "big"

        lines: list[str] = []
        table = self.table(data, (), "interrupts")
        if "interrupts" in data:
            path = ("interrupts",)
            self.keys(table, path, ("address", "lines", "level"))
            lines = table.get("lines", [])
            if not isinstance(lines, list) or not 1 <= len(lines) <= 32 \
                    or not all(isinstance(n, str) and _NAME.fullmatch(n) for n in lines) \
                    or len(set(lines)) != len(lines):
                self.refuse((*path, "lines"), "`lines` are 1 to 32 different names",
                            f"it is {shown(lines)}", 'write for example ["tick", "telecommand"]')
                lines = []
        level = self.integer(table, ("interrupts",), "level", 1, 15, None) or 0

        clock, clock_interrupt = None, None
        if "clock" in data:
            of_clock = self.table(data, (), "clock")
            self.keys(of_clock, ("clock",), ("address", "interrupt"))
            clock = self.place(of_clock, ("clock",), "address", CLOCK_SIZE, "the clock")
            clock_interrupt = self.line(of_clock, ("clock",), "interrupt", lines, False, "the clock")
        interrupts = self.place(table, ("interrupts",), "address", INTERRUPT_SIZE * len(lines), "the interrupts") \
            if "interrupts" in data else None

        slave = self.slave(data, lines) if "slave_clock" in data else None
        names: dict[str, tuple] = {}
        snorkels = [self.snorkel(table, ("snorkel", i), names, order, lines)
                    for i, table in enumerate(self.tables(data, (), "snorkel"))]
        size = size or max(8, self.free())
        self.no_overlap(size)
        return Board(name, self.text(data, (), "doc", ""), base, size, order, clock,
                     clock_interrupt, interrupts, tuple(lines), level,
                     tuple(s for s in snorkels if s), file,
                     tuple(self.bound(table, ("bound", i))
                           for i, table in enumerate(self.tables(data, (), "bound"))), slave)

    def slave(self, data: dict, lines: list[str]) -> Slave:
        table = self.table(data, (), "slave_clock")
        path = ("slave_clock",)
        self.keys(table, path, _SLAVE_KEYS)
        address = self.place(table, path, "address", SLAVE_SIZE, "the slave clock")
        rates = {}
        for key, default, low, high, factor, unit in (
                ("start", 0.0, -9e9, 9e9, 1e9, "s"), ("drift", 0.0, -1e6, 1e6, 1e3, "ppm"),
                ("slew", 100.0, 1e-3, 1e6, 1e3, "ppm"), ("pulse", 1.0, 1e-6, 9e9, 1e9, "s")):
            value = self.number(table, path, key, default)
            if not low <= value <= high:
                self.refuse((*path, key), f"`{key}` is from {low:g} to {high:g} {unit}", f"it is {value:g}",
                            "choose one of those")
            rates[key] = round(value * factor)
        return Slave(address or 0, self.line(table, path, "interrupt", lines, False, "the slave clock"), **rates)

    def bound(self, table: dict, path: tuple) -> Bound:
        self.keys(table, path, _BOUND_KEYS)
        at_most = self.number(table, path, "at_most")
        after = self.number(table, path, "after", 0.0)
        for key, value in (("at_most", at_most), ("after", after)):
            if not value >= 0.0:
                self.refuse((*path, key), f"`{key}` is at least 0", f"it is {value:g}", "write a positive number")
        return Bound(self.text(table, path, "field"), at_most, after, self.text(table, path, "scenario", "") or None,
                     line_of(self.lines, (*path, "field")))

    def line(self, table: dict, path: tuple, key: str, lines: list[str], from_flight: bool, what: str) -> str | None:
        if key not in table:
            return None
        if not lines:
            self.refuse((*path, key), "an interrupt is one of the board's lines", "it has none",
                        "add [interrupts] with address and lines")
            return None
        line = self.choice(table, path, key, tuple(lines))
        if line:
            side, first = self.raised.setdefault(line, (from_flight, what))
            if side != from_flight:
                self.refuse((*path, key), "a line is raised by one side",
                            f"`{line}` is raised by {first} from the other side",
                            "use another line")
        return line

    def place(self, table: dict, path: tuple, key: str, size: int, what: str, multiple: int = 8) -> int | None:
        """The address that the key gives; without it, behind all before."""
        address = self.integer(table, path, key, 0, 0xFFFFFFFC // multiple * multiple, None, multiple=multiple)
        if key not in table:
            address = self.free()
        if address is not None and size:
            self.taken.append((address, address + size, what, (*path, key)))
        return address

    def free(self) -> int:
        """The first address behind all that has one."""
        return -(-max((end for _, end, _, _ in self.taken), default=0) // STEP) * STEP

    def no_overlap(self, size: int) -> None:
        reach = None
        for taken in sorted(self.taken, key=lambda t: t[:2]):
            address, end, what, path = taken
            if end > size:
                self.refuse(path, "all lies within the board's size", f"{what} ends at {end:#x}, "
                            f"the board at {size:#x}", "move it, or enlarge `size`")
            if reach and address < reach[1]:
                self.refuse(path, "addresses do not overlap",
                            f"{what} [{address:#x}, {end:#x}) overlaps {reach[2]} "
                            f"[{reach[0]:#x}, {reach[1]:#x})",
                            f"move it to {reach[1]:#x} or beyond")
            if not reach or end > reach[1]:
                reach = taken

    # ---- a snorkel

    def snorkel(self, table: dict, path: tuple, names: dict[str, tuple], board_order: str,
                lines: list[str]) -> Snorkel | None:
        self.keys(table, path, _SNORKEL_KEYS)
        name = self.name(table, path, names, "snorkel")
        form = self.choice(table, path, "form", FORMS)
        direction = self.choice(table, path, "direction", DIRECTIONS)
        if not form or not direction:
            return None
        self.fitting(table, path, name, form, direction)
        shape = self.queue(table, path, name) | dict(form=form)
        sides = {"read": {"": False}, "write": {"": True}, "both": {"": False, "write_": True}}[direction]
        numbers = {prefix: self.numbers(table, path, prefix, form) for prefix in sides}
        variable, capacity, message_size = self.capacity(table, path, form, all(numbers.values()))
        message, header = None, None
        if form == "message" and ("message" in table or "header" in table):
            message, header = self.message(table, path, variable)
        swap = self.choice(table, path, "outside_order", ORDERS, board_order) != board_order
        unit = self.choice(table, path, "unit", UNITS, 1) or 1
        if swap and unit == 1:
            self.refuse((*path, "outside_order"), "sides of different order have a unit to swap",
                        "`unit` is 1 or not there", "give `unit` = 2, 4 or 8")
        shape |= dict(capacity=capacity, variable=variable, unit=unit, swap=swap)

        names_of_fields: dict[str, tuple] = {}
        lanes: list[Lane] = []
        for prefix, from_flight in sides.items():
            suffix = ("_write" if from_flight else "_read") if direction == "both" else ""
            lane = self.lane(table, path, prefix, name + suffix, from_flight, lines, shape, numbers[prefix])
            if prefix and "write_field" not in table and not numbers[prefix]:
                fields = lanes[0].fields
            else:
                fields = self.lane_fields(table, path, prefix, numbers[prefix], names_of_fields, lane, board_order)
            lanes.append(replace(lane, fields=fields))
            names.setdefault(name + suffix, (*path, "name"))
        return Snorkel(name, self.text(table, path, "doc", ""), direction, tuple(lanes),
                       message, header, message_size)

    def fitting(self, table: dict, path: tuple, name: str, form: str, direction: str) -> None:
        """Refuse keys that a snorkel of this form and direction does not have."""
        for key, forms in _ONLY_FOR.items():
            if key in table and form not in forms:
                self.refuse((*path, key), f"`{key}` is for {' and '.join(forms)}",
                            f"`{name}` is a {form}", "leave it out")
        if direction != "both":
            for key in (k for k in table if k.startswith("write_")):
                self.refuse((*path, key), f"`{key}` is for direction \"both\"",
                            f"`{name}` has only one lane", f"write `{key[6:]}`")

    def queue(self, table: dict, path: tuple, name: str) -> dict[str, Any]:
        """How many packets or words a lane holds, and which of them flight and outside see."""
        queue = self.integer(table, path, "queue", 1, 65536, None)
        if queue and queue & (queue - 1):
            self.refuse((*path, "queue"), "a queue's depth is a power of two", f"it is {queue}",
                        f"choose {1 << queue.bit_length() - 1} or {1 << queue.bit_length()}")
        for key in ("overflow", "sees"):
            if key in table and not queue:
                self.refuse((*path, key), f"`{key}` is of queues", f"`{name}` has none",
                            "leave it out, or give `queue`")
        overwrite = self.choice(table, path, "overflow", OVERFLOWS, "refuse") == "overwrite"
        newest = self.choice(table, path, "sees", SEES, "oldest") == "newest"
        count = self.integer(table, path, "count", 1, 65536, 1) or 1
        if queue and count > 1:
            self.refuse((*path, "count"), "`count` is of words that are not queued",
                        f"`{name}` is queued", "leave it out, or the queue")
        return dict(queued=bool(queue), depth=queue or SINGLE_SLOTS, overwrite=overwrite, newest=newest, count=count)

    def lane_fields(self, table: dict, path: tuple, prefix: str, numbers: list[Number] | None, names: dict[str, tuple],
                    lane: Lane, order: str) -> tuple[Field, ...]:
        key = prefix + "field"
        if numbers:
            if key in table:
                self.refuse((*path, key), f"a packet has fields, or `{prefix}carries` that names its numbers",
                            "both are there", "leave one out")
            return self.carried_fields(numbers, names, lane, order, (*path, prefix + "carries"))
        if lane.form == "packet":
            return self.packet_fields(table, path, key, names, lane, order)
        return self.fields(table, path, key, names)

    def numbers(self, table: dict, path: tuple, prefix: str, form: str) -> list[Number] | None:
        """The numbers that `carries` of a packet names."""
        key = prefix + "carries"
        value = table.get(key)
        paths = value if isinstance(value, list) else [value]
        if form != "packet" or value is None or not all(isinstance(source, str) for source in paths) or not paths:
            if form == "packet" and value is not None:
                self.refuse((*path, key), f"`{key}` names a message, a part of it, or a list of parts",
                            f"it is {shown(value)}", 'write for example "world.power.telemetry"')
            return None
        numbers_: list[Number] = []
        for source in paths:
            try:
                numbers = self.carried(source) if self.carried else None
            except LookupError as error:
                self.refuse((*path, key), "a packet carries numbers of the mission", str(error.args[0]), "name one")
                continue
            if numbers is None and isinstance(value, list):
                self.refuse((*path, key), "a list names numbers of a mission", f"{source} is none", "leave it out")
            numbers_ += numbers or []
        return numbers_ or None

    def capacity(self, table: dict, path: tuple, form: str, known: bool) -> tuple[bool, int, int | None]:
        """(variable, bytes in a slot, bytes of a message's struct). known: by the numbers of each packet."""
        if form == "word":
            return False, 4, None
        given = [key for key in ("size", "capacity") if key in table]
        if known and not given:
            return False, 0, None
        if len(given) != 1:
            self.refuse((*path, given[-1] if given else "size"),
                        "a packet is of fixed `size` or of variable size up to `capacity`",
                        "both are given" if given else "neither is given",
                        "give one, in bytes, or `carries` of numbers, in a flight of their mission")
            return False, 8, None
        n = self.integer(table, path, given[0], 1, 0xFFFFFF) or 8
        if form == "message":
            return given[0] == "capacity", n + CDR_HEAD, n
        return given[0] == "capacity", n, None

    def message(self, table: dict, path: tuple, variable: bool) -> tuple[str | None, str | None]:
        name, header = self.text(table, path, "message"), self.text(table, path, "header")
        if "message" in table and not _TYPE_NAME.fullmatch(name):
            self.refuse((*path, "message"), "`message` is the name of a type",
                        f"it is {shown(name)}", 'write for example "AttError"')
        if "header" in table and not re.fullmatch(r"[\w./-]+\.h", header):
            self.refuse((*path, "header"), "`header` is what flight code includes",
                        f"it is {shown(header)}", 'write for example "flight/msg/attitude.h"')
        if variable:
            self.refuse((*path, "capacity"), "a snorkel of one message type has its size",
                        "it has a `capacity`", "give `size`, or no `message`")
        return name, header

    def lane(self, table: dict, path: tuple, prefix: str, name: str, from_flight: bool, lines: list[str],
             shape: dict[str, Any], numbers: list[Number] | None) -> Lane:
        form, queued, depth = shape["form"], shape["queued"], shape["depth"]
        remove = self.integer(table, path, prefix + "remove", 0, 65535, 0) or 0
        add = table.get(prefix + "add", [])
        if not isinstance(add, list) or not all(type(b) is int and 0 <= b <= 255 for b in add):
            self.refuse((*path, prefix + "add"), "`add` is a list of bytes, each 0 to 255",
                        f"it is {shown(add)}", "write for example [0x1A, 0xCF]")
            add = []
        capacity = shape["capacity"] or _end_of(numbers or [], remove if from_flight else len(add))
        shape = shape | dict(capacity=capacity)
        plain = form == "word" and not queued
        stride = 4 if form == "word" else (SLOT_HEAD + capacity + 7) // 8 * 8
        size = 4 * shape["count"] if plain else CONTROL_SIZE + depth * stride
        address = self.place(table, path, prefix + "address", size, f"`{name}`", 4 if plain else 8)
        descriptor = self.descriptor(table, path, prefix, name, shape)
        # The slot holds a header that the outside adds, or that it will remove.
        inside = remove if from_flight else len(add)
        if inside > capacity:
            self.refuse((*path, prefix + ("remove" if from_flight else "add")),
                        "a header fits into the packet", f"it has {inside} bytes of {capacity}",
                        "shorten it, or enlarge the packet")
        elif shape["swap"] and not shape["variable"] and (capacity - inside) % shape["unit"]:
            self.refuse((*path, "unit"), "a packet is made of whole units",
                        f"without header it has {capacity - inside} bytes",
                        f"make that a multiple of {shape['unit']}, or choose another unit")
        interrupt = self.line(table, path, prefix + "interrupt", lines, from_flight, f"`{name}`")
        return Lane(name=name, from_flight=from_flight, address=address or 0, size=size,
                    stride=stride, interrupt=interrupt, descriptor=descriptor, remove=remove,
                    add=tuple(add), fields=(),
                    carries=None if numbers else self.text(table, path, prefix + "carries", "") or None,
                    line=line_of(self.lines, (*path, prefix + "carries")), **shape)

    def descriptor(self, table: dict, path: tuple, prefix: str, name: str, shape: dict[str, Any]) -> Descriptor:
        key = prefix + "descriptor"
        if key not in table:
            if table.get("direction") == "both" and prefix and "descriptor" in table:
                self.refuse((*path, "descriptor"), "both lanes have descriptors, or none",
                            "`write_descriptor` is not there", "give it")
            return Descriptor()
        given = self.table(table, path, key)
        here = (*path, key)
        self.keys(given, here, _DESCRIPTOR_KEYS)
        address = self.place(given, here, "address", 4 * shape["depth"], f"the descriptors of `{name}`", 4)
        parts = {}
        used = 0
        for part, default in (("length", (0, 24)), ("tag", (24, 7)), ("valid", (31, 1))):
            lsb, bits = parts[part] = self.bits(given, here, part, 0, default)
            mask = ((1 << bits) - 1) << lsb
            if used & mask:
                self.refuse((*here, part), "the parts of a describing word do not overlap",
                            f"`{part}` overlaps another", "move it")
            used |= mask
        if parts["valid"][1] > 1:
            self.refuse((*here, "valid"), "`valid` is one bit or none",
                        f"it has {parts['valid'][1]}", "write [31, 1], or [0, 0]")
        bits = parts["length"][1]
        if shape["variable"] and shape["capacity"] >= 1 << bits:
            self.refuse((*here, "length"), "`length` can hold the capacity",
                        f"{bits} bits do not hold {shape['capacity']}", "give it more bits")
        return Descriptor(address, **parts)

    def bits(self, table: dict, path: tuple, key: str, fewest: int, default: Any = ...) -> tuple[int, int]:
        value = table.get(key, default)
        if value is ... or not isinstance(value, (list, tuple)) or len(value) != 2 \
                or not all(type(v) is int for v in value) \
                or not (value[0] >= 0 and value[1] >= fewest and sum(value) <= 32):
            found = "it is not there" if value is ... else f"it is {shown(value)}"
            self.refuse((*path, key), f"`{key}` is [lowest bit, how many] within 32 bits", found,
                        "write for example [4, 12]")
            return (0, 32)
        return value[0], value[1]

    def fields(self, table: dict, path: tuple, key: str, names: dict[str, tuple]) -> tuple[Field, ...]:
        fields, used = [], 0
        for i, given in enumerate(self.tables(table, path, key)):
            here = (*path, key, i)
            before = len(self.problems)
            self.keys(given, here, _FIELD_KEYS)
            name = self.name(given, here, names, "field")
            lsb, bits = self.bits(given, here, "bits", 1)
            scale = self.number(given, here, "scale", 1.0)
            if scale == 0.0:
                self.refuse((*here, "scale"), "`scale` is not 0", "it is 0",
                            "give the value of one count")
            mask = ((1 << bits) - 1) << lsb
            if used & mask and before == len(self.problems):
                self.refuse((*here, "bits"), "fields of a word do not overlap",
                            f"`{name}` overlaps another one", "move it")
            used |= mask
            fields.append(Field(name, self.text(given, here, "doc", ""), lsb, bits,
                                bool(self.value(given, here, "signed", (bool,), "true or false",
                                                False)),
                                scale, self.number(given, here, "offset", 0.0),
                                self.text(given, here, "unit", "-"),
                                self.text(given, here, "carries", "") or None,
                                line_of(self.lines, (*here, "carries"))))
        return tuple(fields)

    def carried_fields(self, numbers: list[Number], names: dict[str, tuple], lane: Lane, order: str,
                       path: tuple) -> tuple[Field, ...]:
        """The numbers of packets behind one side's header, in their order."""
        fields = []
        common = os.path.commonprefix([number.path for number in numbers]).rpartition(".")[0]
        for number, at in zip(numbers, _places(numbers, lane.remove if lane.from_flight else len(lane.add))):
            bits, signed, _ = NUMBERS[number.type]
            stem = re.sub("[^a-z0-9]+", "_", number.path[len(common):].lower()).strip("_")
            tries = itertools.chain((stem, f"write_{stem}"), (f"{stem}_{n}" for n in itertools.count(2)))
            name = next(candidate for candidate in tries if candidate not in names and candidate not in _KEYWORDS)
            names[name] = path
            fields.append(Field(name, number.doc, 0, bits, signed, 1.0, 0.0, number.unit, number.path,
                                line_of(self.lines, path), at, number.type, order, number.count))
        if fields[-1].end > lane.capacity:
            self.refuse(path, "numbers stand within the packet",
                        f"they end at {fields[-1].end} of {lane.capacity} bytes", "leave out its size, or enlarge it")
        return tuple(fields)

    def packet_fields(self, table: dict, path: tuple, key: str, names: dict[str, tuple], lane: Lane,
                      order: str) -> tuple[Field, ...]:
        """The fields of packets. Only one side's header may be in front of them: the outside drops the other."""
        fields: list[Field] = []
        first = lane.remove if lane.from_flight else len(lane.add)
        tags = 1 << lane.descriptor.tag[1] if lane.descriptor.address is not None else 1
        for i, given in enumerate(self.tables(table, path, key)):
            here = (*path, key, i)
            before = len(self.problems)
            self.keys(given, here, _PACKET_FIELD_KEYS)
            type_ = self.choice(given, here, "type", tuple(NUMBERS))
            bits, signed, _ = NUMBERS[type_ or "u8"]
            scale = self.number(given, here, "scale", 1.0)
            if scale == 0.0:
                self.refuse((*here, "scale"), "`scale` is not 0", "it is 0", "give the value of one count")
            name, doc = self.name(given, here, names, "field"), self.text(given, here, "doc", "")
            field = Field(name, doc, 0, bits, signed, scale,
                          self.number(given, here, "offset", 0.0), self.text(given, here, "unit", "-"),
                          self.text(given, here, "carries", "") or None, line_of(self.lines, (*here, "carries")),
                          self.integer(given, here, "at", 0, 0xFFFFFF) or 0, type_,
                          self.choice(given, here, "order", ORDERS, order) or "big",
                          self.integer(given, here, "count", 1, 65535, 1) or 1,
                          self.integer(given, here, "tag", 0, 255, 0) or 0)
            if before == len(self.problems):
                if field.at < first:
                    self.refuse((*here, "at"), "numbers stand behind the header, which is not theirs",
                                f"{first} bytes in front are the header, `{field.name}` is at {field.at}", "move it")
                if field.end > lane.capacity:
                    self.refuse((*here, "at"), "numbers stand within the packet",
                                f"`{field.name}` ends at {field.end} of {lane.capacity} bytes",
                                "move it, or enlarge the packet")
                if field.tag >= tags:
                    self.refuse((*here, "tag"), f"a tag is from 0 to {tags - 1}, as the descriptor holds it",
                                f"it is {field.tag}", "choose one of those, or give a `descriptor`")
                for other in fields:
                    if other.tag == field.tag and other.at < field.end and field.at < other.end:
                        self.refuse((*here, "at"), "numbers of one packet do not overlap",
                                    f"`{field.name}` [{field.at}, {field.end}) overlaps `{other.name}` "
                                    f"[{other.at}, {other.end})", "move it, or give it another tag")
            fields.append(field)
        return tuple(fields)


def _places(numbers: list[Number], first: int) -> list[int]:
    """Where numbers in a row stand: each type at a multiple of its size, as C has it, behind `first` bytes."""
    places, at = [], 0
    for number in numbers:
        size = NUMBERS[number.type][0] // 8
        places.append(first + -(-at // size) * size)
        at = places[-1] - first + number.count * size
    return places


def _end_of(numbers: list[Number], first: int) -> int:
    """[bytes] of a packet of them, a multiple of 4 behind its header."""
    last = numbers[-1]
    end = _places(numbers, first)[-1] - first + last.count * NUMBERS[last.type][0] // 8
    return first + -(-end // 4) * 4

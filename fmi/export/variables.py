# SPDX-License-Identifier: Apache-2.0
"""The variables of an FMU: of each number of its messages and parameters the reference, name, type, unit, meaning,
start and place in memory. The model description (description.py) and the table that the FMU reads (fmi/fmu/system.h)
are made of the same list."""
from __future__ import annotations

import re
import struct as packing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field as with_default, replace
from math import prod
from typing import Any

from fledge.commands import leaves
from fledge.elements import ELEMENTS
from fledge.export.c_text import wrap
from fledge.export.names import distinct
# Name, meaning, and (name, value, meaning) of each enumerator.
Enumeration = tuple[str, str, Sequence[tuple[str, int, str]]]


@dataclass(frozen=True)
class Variable:
    """An array of elements, a number or a text."""
    reference: int              # of the first element; those of the others follow
    name: str                   # world.nav.attitude.sigma_BN; elements of arrays count from 1, as in cards[1].voltage
    role: str                   # FmuRole without FMU_, in lower case
    type: str                   # f64, ..., u64, enum; char: a text
    shape: tuple[int, ...] = ()     # of numbers
    n: int = 1                  # elements; of a text its bytes, with the zero that ends it
    block: int = 0
    offset: int = 0             # [bytes] in the block
    unit: str = ""              # "" or "-": none
    dims: tuple[int, ...] = ()  # exponents of m, kg, s, A, K, mol, cd, rad
    meaning: str = ""
    enumeration: Enumeration | None = None
    start: tuple[Any, ...] = ()     # of inputs and parameters: a value for each element, or the text
    bounds: tuple[float | None, float | None] = (None, None)    # of parameters

    @property
    def references(self) -> int:
        """How many there are of it."""
        return 1 if self.type == "char" else self.n

    @property
    def row(self) -> list[Any]:
        """[reference, role, type, n, block, offset]"""
        return [self.reference, self.role, self.type, self.n, self.block, self.offset]


@dataclass(frozen=True)
class Message:
    """A message in memory. `first` and `n` say which variables are its own."""
    path: str                   # world.nav.attitude
    struct: Any
    role: str                   # input, output, local
    block: int
    offset: int                 # [bytes] of its Head
    start: bytes = b""          # of an input; none: all zero
    latency: str = "same_instant"   # of an input, as the importer must see to: mission/crossing.py
    first: int = 0              # the place of its first variable
    n: int = 0


@dataclass(frozen=True)
class Parameters:
    """The parameters of a module or model."""
    path: str                   # flight.control
    struct: Any
    block: int
    offset: int                 # [bytes] of the whole struct in the block
    memory: bytes               # of the whole struct
    fixed: bool = False         # they count at the start alone; else only those that are initial values
    left_out: Sequence[str] = ()    # parts of paths that are no variables: long tables, as of stored commands


@dataclass(frozen=True)
class Process:
    """A process with modes."""
    name: str
    modes: Sequence[str]


@dataclass(frozen=True)
class Event:
    process: str
    name: str
    meaning: str                # its condition in words


@dataclass(frozen=True)
class Layout:
    """All of an FMU."""
    variables: list[Variable]
    messages: list[Message]     # with the places of their variables
    processes: list[Process] = with_default(default_factory=list)
    events: list[Event] = with_default(default_factory=list)

    @property
    def inputs(self) -> list[Message]:
        return [message for message in self.messages if message.role == "input"]

    def rows(self) -> dict[str, list[list[Any]]]:
        """The table as data, for a system that reads it from a file: of the variables [reference, role, type, n, block,
        offset], of the messages that come in [first, n, block, offset]."""
        return {"variables": [v.row for v in self.variables],
                "messages": [[m.first, m.n, m.block, m.offset] for m in self.inputs]}

    def c_table(self) -> list[str]:
        """The same as lines of C: `variables` and `messages`, and `layout` of both."""
        rows = [f"{{{v.reference}u, FMU_{v.role.upper()}, FLEDGE_{v.type.upper()}, {v.n}u, {v.block}u, {v.offset}u}},"
                for v in self.variables]
        lines = wrap(rows, "static const FmuVariable variables[] = {", "    ", "};")
        if self.inputs:
            lines += wrap([f"{{{m.first}u, {m.n}u, {m.block}u, {m.offset}u}}," for m in self.inputs],
                          "static const FmuMessage messages[] = {", "    ", "};")
        return [*lines, f"static const FmuLayout layout = {{variables, {len(rows)}u, "
                f"{'messages' if self.inputs else '0'}, {len(self.inputs)}u, {len(self.processes)}u, "
                f"{len(self.events)}u}};"]


def listed(messages: Iterable[Message], parameters: Iterable[Parameters] = (), processes: Sequence[Process] = (),
           events: Sequence[Event] = (), packets: Mapping[str, int] = {}, heads: bool = True) -> Layout:
    """The variables of all these, in this order. `spare` fields are left out. packets: process -> [bytes] of packets
    that it takes at an instant, of those that exchange them with the ground. heads: whether those of inputs are
    variables, too; else the FMU makes them."""
    variables: list[Variable] = []
    placed: list[Message] = []
    messages, parameters = list(messages), list(parameters)
    taken = {".".join(path.split(".")[:2]) for path in (*(m.path for m in messages), *(p.path for p in parameters))}

    def path(process: str, kind: str) -> str:
        """flight.clock; where an instance has this name, flight.clock_"""
        return f"{process}.{kind}" if f"{process}.{kind}" not in taken else path(process, f"{kind}_")

    def add(some: Iterable[Variable]) -> None:
        for each in some:
            last = variables[-1] if variables else None
            variables.append(replace(each, reference=last.reference + last.references if last else 0))

    add([Variable(0, "time", "time", "f64", unit="s", dims=(0, 0, 1, 0, 0, 0, 0, 0), meaning="the FMU's time")])
    for message in messages:
        first = len(variables)
        memory = message.start or bytes(message.struct.size)
        own = _fields(message.struct.fields, message.path, memory, message.offset, role=message.role,
                      block=message.block)
        add(v for v in own if heads or message.role != "input" or not v.name.startswith(f"{message.path}.head."))
        placed.append(replace(message, first=first, n=len(variables) - first))
    for each in parameters:
        add(_parameters(each))
    for i, process in enumerate(processes):
        add(_modes(process, i, path))
    words = {process: distinct([e.name for e in events if e.process == process], ["mode"])
             for process in {event.process for event in events}}
    for i, event in enumerate(events):
        name = words[event.process][event.name]
        add([Variable(0, f"{path(event.process, 'fired')}.{name}", "fired", "u32", block=i,
                      meaning=f"how often the event has fired: {event.meaning}"),
             Variable(0, f"{path(event.process, 'clock')}.{name}", "clock_event", "u8", block=i,
                      meaning=f"ticks when the event fires: {event.meaning}")])
    for i, (name, room) in enumerate(packets.items()):
        add([Variable(0, path(name, "uplink"), "uplink", "u8", block=i, bounds=(None, room),
                      meaning="commands: space packets, whole and one after the other"),
             Variable(0, path(name, "downlink"), "downlink", "u8", block=i,
                      meaning="telemetry: the space packets of the last step")])
    return Layout(variables, placed, list(processes), list(events))


def _parameters(owner: Parameters) -> Iterator[Variable]:
    for f in owner.struct.fields:
        if f.group == "par":
            role = "fixed" if owner.fixed or f.initial else "parameter"
            yield from _fields([f], owner.path, owner.memory, owner.offset, role=role, block=owner.block,
                               left_out=owner.left_out)


def _fields(fields: Sequence[Any], path: str, memory: bytes, base: int, role: str, block: int,
            left_out: Sequence[str] = ()) -> Iterator[Variable]:
    for name, f, at in leaves(fields):
        if f.spare or any(part in name for part in left_out):
            continue
        name = re.sub(r"\[(\d+)\]", lambda index: f"[{int(index[1]) + 1}]", name)
        width, raw = ELEMENTS[f.type].size, memory[at:at + f.size]
        facts = Variable(0, f"{path}.{name}", "fixed" if role == "parameter" and f.initial else role, f.type,
                         block=block, unit=f.unit, dims=tuple(f.dims), meaning=f.doc,
                         enumeration=f.enumeration if f.type == "enum" else None)
        starts = role in ("input", "parameter", "fixed")
        if f.type == "char":        # of an array of texts, each is a variable
            size = f.shape[-1] if f.shape else 1
            for i in range(f.size // size):
                text = raw[i * size:(i + 1) * size].split(b"\0")[0].decode("utf-8", "replace")
                yield replace(facts, name=facts.name + (f"[{i + 1}]" if len(f.shape) > 1 else ""), n=size,
                              offset=base + at + i * size, start=(text,) if starts else ())
            continue
        n = f.size // width
        values = packing.unpack(f"={n}{ELEMENTS[f.type].code}", raw) if starts else ()
        yield replace(facts, shape=tuple(f.shape), n=prod(f.shape), offset=base + at, start=values,
                      bounds=_bounds(f, values) if role in ("parameter", "fixed") else (None, None))


def _bounds(f: Any, values: Sequence[float]) -> tuple[float | None, float | None]:
    """The least and the greatest allowed number, which the start of the variable keeps: rows of a table that do not
    count need not."""
    low, high, *_ = f.bounds
    return (low if low is None or all(value >= low for value in values) else None,
            high if high is None or all(value <= high for value in values) else None)


def _modes(process: Process, place: int, path: Callable[[str, str], str]) -> Iterator[Variable]:
    rows = [(mode, i, "") for i, mode in enumerate(process.modes, 1)]
    kind = f"{process.name}.Mode"
    yield Variable(0, path(process.name, "mode"), "mode", "enum", block=place, meaning="the mode in force",
                   enumeration=(kind, f"the modes of {process.name}", rows))
    yield Variable(0, path(process.name, "request"), "request", "enum", block=place, start=(0,),
                   meaning="the mode to enter at the next instant; none: stay",
                   enumeration=(f"{process.name}.Request", f"the modes of {process.name}, or none",
                                [("none", 0, "no request"), *rows]))
    yield Variable(0, f"{path(process.name, 'clock')}.mode", "clock_mode", "u8", block=place,
                   meaning="ticks when the mode changes")
